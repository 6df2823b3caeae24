"""Plots the curves of the chapter on performance (needs matplotlib):

    cargo bench -p artgs --bench step | python3 docs/curves.py docs/src/images/curves.png
"""
import re
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

curves, name = {}, None
for line in sys.stdin:
    if heading := re.match(r"[├╰]─ (\w+)", line):
        name = heading[1]
    if row := re.match(r"\W+(\d+)\s+([\d.]+) ms\s+│", line):
        curves.setdefault(name, []).append((int(row[1]), float(row[2])))

titles = {
    "pixels": ("image area, megapixels", lambda n: n * n / 1e6),
    "gaussians": ("Gaussians, thousands (400 x 400)", lambda n: n / 1e3),
    "parts": ("parts (400 x 400, 30,000 Gaussians)", lambda n: n),
}
figure, axes = plt.subplots(1, 3, figsize=(10, 3), sharey=False)
for axis, (name, (label, scale)) in zip(axes, titles.items()):
    points = sorted(curves[name])
    axis.plot([scale(n) for n, _ in points], [t for _, t in points], "o-")
    axis.set(xlabel=label, ylim=(0, 1.15 * max(t for _, t in points)))
    axis.grid(alpha=0.3)
axes[0].set_ylabel("step, ms (fastest of 100)")
figure.tight_layout()
figure.savefig(sys.argv[1], dpi=90)
