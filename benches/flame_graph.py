#!/usr/bin/env python3
"""A flame graph of one run of `ifg fix` on one thread, as SVG.

    benches/flame_graph.py BODY.ply GARMENT.ply ... --ifg target/release/ifg --out flame.svg [--title TEXT]

Needs perf, and inferno (cargo install inferno). Frames of the standard library and of thread pools are left out: a
part that runs as a task stands beside the call that waits for it.
"""
import argparse, collections, os, re, subprocess, tempfile

a = argparse.ArgumentParser()
a.add_argument('body'), a.add_argument('garments', nargs='+')
a.add_argument('--ifg', default='target/release/ifg')
a.add_argument('--out', required=True)
a.add_argument('--title', default='ifg fix, one thread')
a = a.parse_args()

LEFT_OUT = re.compile(r'<*&?(rayon|core|std|alloc|crossbeam|sys::)|\[|_start|start_thread|__libc|main$|clone|_dl_|__rust|_dl$')
with tempfile.TemporaryDirectory() as folder:
    data = os.path.join(folder, 'perf.data')
    command = [a.ifg, '--threads', '1', 'fix', '--body', a.body, *a.garments, '--no-pictures', '--out', folder + '/out']
    record = ['perf', 'record', '-q', '-F', '499', '--call-graph', 'dwarf,65000', '-o', data, *command]
    subprocess.run(record, check=True, stdout=subprocess.DEVNULL)
    script = subprocess.Popen(['perf', 'script', '--no-inline', '-i', data], stdout=subprocess.PIPE)
    collapsed = subprocess.run(['inferno-collapse-perf'], stdin=script.stdout, capture_output=True, text=True, check=True)
stacks = collections.Counter()
for line in collapsed.stdout.splitlines():
    stack, nanoseconds = line.rsplit(' ', 1)
    frames = ['ifg fix']
    for name in stack.split(';')[1:]:
        name = re.sub(r'<(\w[\w:]*(?:<.*?>)?) as [\w:<>, ]+>::', r'\1::', name).replace('::{{closure}}', '')
        # A closure is part of its function, and a function that calls itself one frame.
        if not LEFT_OUT.match(name) and name != frames[-1]:
            frames.append(name)
    stacks[';'.join(frames)] += int(nanoseconds) // 1000
folded = ''.join(f'{stack} {time}\n' for stack, time in sorted(stacks.items()))
draw = ['inferno-flamegraph', '--width', '1400', '--minwidth', '0.4', '--title', a.title, '--countname', 'µs', '--hash']
svg = subprocess.run(draw, input=folded, capture_output=True, text=True, check=True).stdout
with open(a.out, 'w', encoding='utf-8') as file:
    file.write(svg)
