"""The peer of benches/examples/evaluate.rs and step.rs: the same network in PyTorch on the CPU.

    python benches/peers/torch_neural.py [fast|paper] [points] [seconds] [threads]

Prints points per second at best and per CPU second: value alone; value and gradient by an adjoint
written out in tensor operations and by autograd; a training step on value, eikonal and normal terms by
double backward and by the explicit adjoint.
"""
import math
import sys
import time

import torch
from torch import nn
from torch.nn.functional import linear, softplus


class Sdf(nn.Module):
    """Appendix E as the lineage builds it; the features are left out where only phi is asked for."""

    def __init__(self, width, layers=8, skip=4, bands=6, features=256, beta=100.0):
        super().__init__()
        self.bands, self.skip, self.layers, self.beta = bands, skip, layers, beta
        encoded = 3 + 6 * bands
        self.linears = nn.ModuleList()
        for layer in range(layers + 1):
            columns = encoded if layer == 0 else width
            rows = 1 + features if layer == layers else width - encoded if layer + 1 == skip else width
            linear_layer = nn.Linear(columns, rows)
            if layer == layers:
                nn.init.normal_(linear_layer.weight, math.sqrt(math.pi) / math.sqrt(width), 1e-4)
                nn.init.constant_(linear_layer.bias, -0.6)
            else:
                nn.init.constant_(linear_layer.bias, 0.0)
                nn.init.normal_(linear_layer.weight, 0.0, math.sqrt(2) / math.sqrt(rows))
                seen = 3 if layer == 0 else columns - (encoded - 3) if layer == skip else columns
                with torch.no_grad():
                    linear_layer.weight[:, seen:] = 0.0
            self.linears.append(nn.utils.parametrizations.weight_norm(linear_layer))
        self.register_buffer("frequencies", 2.0 ** torch.arange(bands))

    def weights(self):
        """W and b of every layer, the last one's row of the distance alone."""
        pairs = [(layer.weight, layer.bias) for layer in self.linears]
        pairs[-1] = (pairs[-1][0][:1], pairs[-1][1][:1])
        return pairs

    def encode(self, x):
        angles = x[:, None, :] * self.frequencies[:, None]
        return torch.cat([x, torch.stack([angles.sin(), angles.cos()], 2).flatten(1)], 1)

    def slopes(self, x):
        f = self.frequencies[:, None]
        angles = x[:, None, :] * f
        waves = torch.stack([f * angles.cos(), -f * angles.sin()], 2).flatten(1)
        return torch.cat([torch.ones_like(x), waves], 1)

    def forward(self, x, weights):
        encoded = self.encode(x)
        a = encoded
        for layer, (weight, bias) in enumerate(weights):
            if layer == self.skip:
                a = torch.cat([a, encoded], 1) / math.sqrt(2)
            a = linear(a, weight, bias)
            if layer < self.layers:
                a = softplus(a, self.beta)
        return a

    def explicit(self, x, weights):
        """phi and its gradient by the adjoint pass, in plain tensor operations."""
        encoded = self.encode(x)
        a, slopes = encoded, []
        for layer, (weight, bias) in enumerate(weights):
            if layer == self.skip:
                a = torch.cat([a, encoded], 1) / math.sqrt(2)
            z = linear(a, weight, bias)
            if layer < self.layers:
                slopes.append(torch.sigmoid(self.beta * z))
                a = softplus(z, self.beta)
        back = weights[-1][0].expand(len(x), -1)
        by_encoding = 0.0
        for layer in reversed(range(self.layers)):
            back = (back * slopes[layer]) @ weights[layer][0]
            if layer == self.skip:
                back = back / math.sqrt(2)
                by_encoding = by_encoding + back[:, -encoded.shape[1]:]
                back = back[:, : -encoded.shape[1]]
        by_encoding = (back + by_encoding) * self.slopes(x)
        return z, by_encoding.view(len(x), -1, 3).sum(1)


def loss_of(value, gradient, normal):
    length = gradient.norm(dim=1)
    return value.square().sum() + (length - 1).square().sum() + (gradient - normal).square().sum()


def measure(seconds, work):
    work()
    begin, cpu, least, calls = time.perf_counter(), time.process_time(), math.inf, 0
    while calls < 2 or time.perf_counter() - begin < seconds:
        start = time.perf_counter()
        work()
        least = min(least, time.perf_counter() - start)
        calls += 1
    return least, (time.process_time() - cpu) / calls


def main():
    arguments = sys.argv[1:] + ["fast", "4096", "2", "2"][len(sys.argv) - 1:]
    preset, count, seconds, threads = arguments[0], int(arguments[1]), float(arguments[2]), int(arguments[3])
    torch.set_num_threads(threads)
    torch.manual_seed(1)
    net = Sdf(512 if preset == "paper" else 256)
    x = torch.rand(count, 3) * 2 - 1
    normal = torch.nn.functional.normalize(torch.randn(count, 3), dim=1)
    frozen = [(w.detach().clone(), b.detach().clone()) for w, b in net.weights()]

    def value():
        with torch.no_grad():
            net(x, frozen)

    def explicit():
        with torch.no_grad():
            net.explicit(x, frozen)

    def autograd():
        at = x.clone().requires_grad_(True)
        torch.autograd.grad(net(at, frozen).sum(), at)

    def step_double():
        net.zero_grad(set_to_none=True)
        at = x.clone().requires_grad_(True)
        phi = net(at, net.weights())
        (gradient,) = torch.autograd.grad(phi.sum(), at, create_graph=True)
        loss_of(phi, gradient, normal).backward()

    def step_explicit():
        net.zero_grad(set_to_none=True)
        phi, gradient = net.explicit(x, net.weights())
        loss_of(phi, gradient, normal).backward()

    # The three ways to the gradient agree.
    at = x.clone().requires_grad_(True)
    (by_autograd,) = torch.autograd.grad(net(at, frozen).sum(), at)
    assert torch.allclose(by_autograd, net.explicit(x, frozen)[1], atol=1e-4)
    print(f"PyTorch {torch.__version__}, {preset}, {count} points, {threads} threads")
    for work in (value, explicit, autograd, step_double, step_explicit):
        least, cpu = measure(seconds, work)
        print(f"{work.__name__:14} {count / least / 1e3:8.1f}k points/s at best, {count / cpu / 1e3:8.1f}k per CPU s")


main()
