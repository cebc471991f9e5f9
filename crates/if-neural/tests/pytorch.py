"""The network of Appendix E in PyTorch, against ours.

    python pytorch.py check NETWORK.safetensors SAMPLES.json    loads our file, compares value and gradient at our points
    python pytorch.py make  NETWORK.safetensors SAMPLES.json    writes a network made by PyTorch, and its samples

Needs torch and numpy; without torch it says so and ends with exit code 77. crates/if-neural/tests/pytorch.rs runs it:

    IF_PYTHON=/path/to/python cargo test -p if-neural --test pytorch -- --ignored
"""

import json
import struct
import sys

try:
    import numpy as np
    import torch
except ImportError as missing:
    print(f"skipped: {missing}; install torch and numpy for this Python ({sys.executable})")
    sys.exit(77)


def load(path):
    """Arrays and metadata of a safetensors file (F32 only)."""
    data = open(path, "rb").read()
    (n,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + n])
    metadata = header.pop("__metadata__", {})
    arrays = {}
    for name, info in header.items():
        assert info["dtype"] == "F32", name
        a, b = info["data_offsets"]
        arrays[name] = torch.from_numpy(np.frombuffer(data[8 + n + a : 8 + n + b], "<f4").reshape(info["shape"]).copy())
    return arrays, metadata


def save(path, arrays, metadata):
    header, at = {"__metadata__": metadata}, 0
    for name, a in arrays.items():
        header[name] = {"dtype": "F32", "shape": list(a.shape), "data_offsets": [at, at + 4 * a.numel()]}
        at += 4 * a.numel()
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text)
        for a in arrays.values():
            file.write(a.detach().numpy().astype("<f4").tobytes())


class Sdf(torch.nn.Module):
    """As in IDR and SelfRecon: positional encoding without pi, one skip, softplus, weight norm."""

    def __init__(self, c):
        super().__init__()
        self.c = c
        encoded = 3 + 6 * c["bands"]
        for l in range(c["layers"] + 1):
            columns = encoded if l == 0 else c["width"]
            if l == c["layers"]:
                rows = 1 + c["features"]
            elif c["skip"] == l + 1:
                rows = c["width"] - encoded
            else:
                rows = c["width"]
            layer = torch.nn.Linear(columns, rows)
            if c["weight_norm"]:
                layer = torch.nn.utils.weight_norm(layer)
            setattr(self, f"lin{l}", layer)
        self.activation = torch.nn.Softplus(beta=c["beta"], threshold=20)

    def encode(self, x):
        parts = [x]
        for band in range(self.c["bands"]):
            parts += [torch.sin(2.0**band * x), torch.cos(2.0**band * x)]
        return torch.cat(parts, -1)

    def forward(self, x):
        encoded = self.encode(x)
        h = encoded
        for l in range(self.c["layers"] + 1):
            if l == self.c["skip"]:
                h = torch.cat([h, encoded], -1) / 2**0.5
            h = getattr(self, f"lin{l}")(h)
            if l < self.c["layers"]:
                h = self.activation(h)
        return h[:, 0]

    def samples(self, points):
        x = torch.tensor(points, dtype=torch.float32, requires_grad=True)
        value = self(x)
        (gradient,) = torch.autograd.grad(value.sum(), x)
        return value.detach(), gradient


def check(network, samples):
    arrays, metadata = load(network)
    config = json.loads(metadata["if_neural"])["network"]["sdf"]
    model = Sdf(config)
    model.load_state_dict(arrays, strict=True)
    ours = json.load(open(samples))
    value, gradient = model.samples(ours["points"])
    v = (value - torch.tensor(ours["values"])).abs().max().item()
    g = (gradient - torch.tensor(ours["gradients"])).abs().max().item()
    print(f"ours in PyTorch: largest difference of values {v:.2e}, of gradients {g:.2e}")
    # Both round to f32: a dozen layers at beta = 100 leave 1e-6 and 1e-4.
    return v < 1e-5 and g < 1e-3


def make(network, samples):
    torch.manual_seed(7)
    config = dict(bands=3, width=48, layers=5, skip=3, beta=100.0, features=4, weight_norm=True, radius=0.6)
    model = Sdf(config)
    points = (torch.rand(64, 3) * 2 - 1).tolist()
    value, gradient = model.samples(points)
    frame = {"center": [0.0, 1.0, 0.0], "scale": 1.25}
    header = {"version": 1, "kind": "network", "network": {"sdf": config}, "frame": frame}
    save(network, model.state_dict(), {"if_neural": json.dumps(header)})
    json.dump({"points": points, "values": value.tolist(), "gradients": gradient.tolist()}, open(samples, "w"))
    return True


if __name__ == "__main__":
    commands = {"check": check, "make": make}
    if len(sys.argv) != 4 or sys.argv[1] not in commands:
        sys.exit(__doc__)
    sys.exit(0 if commands[sys.argv[1]](sys.argv[2], sys.argv[3]) else 1)
