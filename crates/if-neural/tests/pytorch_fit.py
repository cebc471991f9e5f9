"""The same recipe as our fit of the paper's networks, in PyTorch: the peer of `fit_table`.

    cargo run --release -p if-benches --example fit_table -- body.ply --networks fast --seconds 60 --dump DIR
    python crates/if-neural/tests/pytorch_fit.py DIR --width 256 --seconds 60 [--threads 2] [--batch 2048] [--rate 1e-3]

Training points, losses, optimiser and schedule are those of `fit_table`; errors are at the same held-out points.
"""

import argparse
import json
import math
import os
import time

import numpy as np
import torch
from pytorch import Sdf


def geometric(model, c):
    """The initialisation of the lineage, by the rows of W as they are with weight norm."""
    for l in range(c["layers"] + 1):
        layer = getattr(model, f"lin{l}")
        w, b = layer.weight_v if c["weight_norm"] else layer.weight, layer.bias
        rows, encoded = w.shape[0], 3 + 6 * c["bands"]
        with torch.no_grad():
            b.zero_()
            if l == c["layers"]:
                w.normal_(math.sqrt(math.pi) / math.sqrt(w.shape[1]), 1e-4)
                b.fill_(-c["radius"])
            else:
                w.normal_(0, math.sqrt(2) / math.sqrt(rows))
                if l == 0:
                    w[:, 3:] = 0
                if l == c["skip"]:
                    w[:, -(encoded - 3) :] = 0
            if c["weight_norm"]:
                layer.weight_g.copy_(w.norm(dim=1, keepdim=True))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dir")
    parser.add_argument("--width", type=int, default=256)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--batch", type=int, default=2048)
    parser.add_argument("--rate", type=float, default=1e-3)
    a = parser.parse_args()
    torch.set_num_threads(a.threads)
    torch.manual_seed(1)
    read = lambda name, n: torch.from_numpy(np.fromfile(f"{a.dir}/{name}.f32", "<f4").reshape(-1, n))
    near, far, held = read("near", 8), read("far", 8), read("held", 4)
    scale = json.load(open(f"{a.dir}/frame.json"))["scale"]
    c = dict(bands=6, width=a.width, layers=8, skip=4, beta=100.0, features=256, weight_norm=True, radius=0.6)
    model = Sdf(c)
    geometric(model, c)
    adam = torch.optim.Adam(model.parameters(), lr=a.rate, betas=(0.9, 0.999), eps=1e-8)
    robust = lambda square, s: torch.sqrt(square + s * s) - s
    n_far = round(0.1 * a.batch)
    start, step = time.time(), 0
    while (spent := time.time() - start) < a.seconds:
        cosine = 0.5 * (1 + math.cos(math.pi * spent / a.seconds))
        rate = a.rate * min(1, (step + 1) / 50) * (0.02 + 0.98 * cosine)
        for group in adam.param_groups:
            group["lr"] = rate
        rows = torch.cat([near[torch.randint(len(near), (a.batch - n_far,))], far[torch.randint(len(far), (n_far,))]])
        x = rows[:, :3].clone().requires_grad_(True)
        value = model(x)
        (g,) = torch.autograd.grad(value.sum(), x, create_graph=True)
        loss = robust((value - rows[:, 3]) ** 2, 2e-3)
        loss = loss + 0.01 * rows[:, 7] * robust(((g - rows[:, 4:7]) ** 2).sum(-1), 0.1)
        loss = loss + 0.01 * 0.5 * (g.norm(dim=-1) - 1) ** 2
        adam.zero_grad()
        loss.mean().backward()
        adam.step()
        step += 1
    errors, slopes = [], []
    for part in held.split(8192):
        value, g = model.samples(part[:, :3].tolist())
        errors.append((value - part[:, 3]).abs() / scale)
        slopes.append((g.norm(dim=-1) - 1).abs())
    errors = torch.cat(errors)
    p99 = errors.kthvalue(math.ceil(0.99 * len(errors))).values
    print("network | seconds | steps | samples/s | mean mm | p99 mm | eikonal")
    print(
        f"PyTorch {a.width} | {spent:.1f} | {step} | {step * a.batch / spent:.0f} | {errors.mean() * 1e3:.3f} | "
        f"{p99 * 1e3:.3f} | {torch.cat(slopes).mean():.4f}"
    )


if __name__ == "__main__":
    main()
