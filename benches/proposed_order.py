#!/usr/bin/env python3
"""`ifg check --order auto` on the outfits of the test data, given outermost first, against the order that their makers had in mind.

    benches/proposed_order.py --ifg target/release/ifg --data ../shared/data [--only o1 r04] [--markdown TABLE.md]

An order is right if all pairs of garments that overlap are proposed as in outfits.json; `ambiguous` is what `fix --order auto` refuses.
"""
import argparse, json, os, subprocess
from outfit_data import outfits


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--ifg", default="target/release/ifg")
    p.add_argument("--data", default="../shared/data")
    p.add_argument("--only", nargs="*")
    p.add_argument("--markdown")
    a = p.parse_args()
    table, counts = [], dict.fromkeys(("right", "wrong", "right, refused", "wrong, refused"), 0)
    pairs_right = pairs = 0
    for body, name, skin, layers, garments in outfits(a.data, ("body_a", "body_b", "body_c"), a.only):
        if len(layers) < 2:
            continue
        run = subprocess.run([a.ifg, "check", "--json", "--order", "auto", "--body", skin, *reversed(garments)],
                             capture_output=True, text=True)
        found = json.loads(run.stdout)["order"]
        place = {g: k for k, g in enumerate(layers)}
        wrong = [q for q in found["pairs"] if place[q["inner"]] > place[q["outer"]]]
        pairs += len(found["pairs"])
        pairs_right += len(found["pairs"]) - len(wrong)
        ambiguous = [q for q in found["pairs"] if q["confidence"] < SURE]
        state = ("wrong" if wrong else "right") + (", refused" if ambiguous else "")
        counts[state] += 1
        say = lambda qs: "; ".join(f"{q['inner']} < {q['outer']} {q['confidence']:.2f}" for q in qs) or "–"
        print(f"{body} {name:24} {state:16} confidence {found['confidence']:5.2f}  wrong: {say(wrong)}  unsure: {say(ambiguous)}", flush=True)
        table.append(f"| {name} | {' < '.join(found['names'])} | {found['confidence']:.2f} | {state} | {say(wrong)} |")
    summary = ", ".join(f"{n} {state}" for state, n in counts.items()) + f"; {pairs_right} of {pairs} pairs right"
    print(summary)
    if a.markdown:
        with open(a.markdown, "w", encoding="utf-8") as out:
            print("| outfit | proposed | confidence | order | wrong pairs |", "|---|---|---|---|---|", *table, "", summary[0].upper() + summary[1:] + ".", sep="\n", file=out)


SURE = 0.3  # if_outfit::order::SURE

if __name__ == "__main__":
    main()
