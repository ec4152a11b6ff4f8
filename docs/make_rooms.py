"""The picture of docs/architecture.md: docs/_static/rooms.svg.

Run: python docs/make_rooms.py
"""

from pathlib import Path

WIDTH, HEIGHT, BOX, GAP = 1000, 330, (132, 46), 30
STYLE = """
text { font: 14px sans-serif; fill: #1b2733; } .small { font-size: 11.5px; fill: #4a5a68; }
rect { fill: #e8f0f7; stroke: #3b6ea5; rx: 6; } rect.noun { fill: #fdf3dc; stroke: #b07c12; }
path { fill: none; stroke: #3b6ea5; stroke-width: 1.6; marker-end: url(#tip); }
@media (prefers-color-scheme: dark) { svg { background: #f7f9fb; } }
"""


def box(x: float, y: float, name: str, note: str = "") -> str:
    """A room, or a noun (a file or a class), and what it does."""
    noun = ' class="noun"' if "." in name or name[0].isupper() else ""
    text = f'<rect{noun} x="{x}" y="{y}" width="{BOX[0]}" height="{BOX[1]}"/>'
    middle, line = x + BOX[0] / 2, y + (20 if note else 28)
    text += f'<text x="{middle}" y="{line}" text-anchor="middle">{name}</text>'
    if note:
        text += f'<text class="small" x="{middle}" y="{y + 37}" text-anchor="middle">{note}</text>'
    return text


def arrow(start: tuple[float, float], end: tuple[float, float]) -> str:
    """An arrow between two points."""
    return f'<path d="M{start[0]} {start[1]} L{end[0]} {end[1]}"/>'


def chain(names: list[tuple[str, str]], y: float) -> list[str]:
    """Rooms in a row, with arrows."""
    parts = []
    for k, (name, note) in enumerate(names):
        x = 10 + k * (BOX[0] + GAP)
        parts.append(box(x, y, name, note))
        if k:
            parts.append(arrow((x - GAP + 2, y + BOX[1] / 2), (x - 4, y + BOX[1] / 2)))
    return parts


def main() -> None:
    """Write the picture."""
    raw = [
        ("raw.png", ""), ("io", "a reader by ending"), ("calibration", "the lattice"),
        ("preparation", "white, dark, drift"), ("rendering", "decode"), ("LightField", "(v, u, t, s)"),
    ]  # fmt: skip
    file = [
        ("camera.toml", ""), ("instruments", "checked, computed"), ("simulation", "which way"),
        ("operators", "light to sensor"), ("sensor", "noise"), ("RawImage", "states its error"),
    ]  # fmt: skip
    parts = chain(raw, 30) + chain(file, 240)
    right = 10 + 5 * (BOX[0] + GAP)
    parts.append('<text class="small" x="10" y="20">one raw image</text>')
    parts.append('<text class="small" x="10" y="312">one camera file</text>')
    ends = [
        (right - 2 * (BOX[0] + GAP), "deconvolution", "volume"),
        (right - (BOX[0] + GAP), "depth", "disparity, metres"),
        (right, "rendering", "refocus"),
    ]
    for x, name, note in ends:
        parts.append(box(x, 135, name, note))
    for x in (right - (BOX[0] + GAP), right):
        parts.append(arrow((right + BOX[0] / 2, 30 + BOX[1]), (x + BOX[0] / 2, 131)))
    middle = right - 2 * (BOX[0] + GAP) + BOX[0] / 2
    parts.append(arrow((middle, 236), (middle, 135 + BOX[1] + 4)))
    parts.append(f'<text class="small" x="{middle + 8}" y="215">operator and transpose</text>')
    parts.append(arrow((middle, 30 + BOX[1]), (middle, 131)))
    second = 10 + BOX[0] + GAP
    parts.append(box(second, 135, "describe", "rows with equations"))
    parts.append(arrow((second + BOX[0] / 2, 236), (second + BOX[0] / 2, 135 + BOX[1] + 4)))
    tip = (
        '<marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0 0 L8 4 L0 8 z" style="fill:#3b6ea5;stroke:none;marker-end:none"/></marker>'
    )
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">'
    title = "<title>The rooms that a raw image and a camera file go through</title>"
    text = "\n".join([head, title, f"<style>{STYLE}</style>", f"<defs>{tip}</defs>", *parts, "</svg>"])
    (Path(__file__).parent / "_static" / "rooms.svg").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
