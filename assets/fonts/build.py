"""Makes the two bundled fonts from Inter 4.1 (npm package `inter-ui` 4.1.1, folder `web/`).

    pip install fonttools brotli
    python build.py path/to/package/web

Digits are replaced by their tabular alternates (feature `tnum`), so that numbers do not dance, and the glyphs
nobody types here are left out. The Inter licence reserves no font name; the family is renamed all the same,
so that nobody takes these files for the originals.
"""

import sys
from fontTools import subset
from fontTools.pens.ttGlyphPen import TTGlyphPen
from fontTools.ttLib import TTFont

TEXT = (
    [c for c in range(0x20, 0x180)]
    + [c for c in range(0x370, 0x400)]
    + [ord(c) for c in "–—‘’“”•…‰′″‹›⁄⁰ⁱ⁴⁵⁶⁷⁸⁹⁺⁻⁽⁾ⁿ₀₁₂₃₄₅₆₇₈₉₊₋€™Ω←↑→↓↔↕⇒⇧⌘⌫↺↻∂∆∏∑−√∞∫≈≠≤≥■□▲▶▼◀◆●○✓✗⚠⋯‖"]
)


def pause_glyph(font):
    """Inter has no U+23F8; two bars as high and as wide as its ▶."""
    glyphs, cmap = font["glyf"], font.getBestCmap()
    play = glyphs[cmap[0x25B6]]
    width, bar = play.xMax - play.xMin, (play.xMax - play.xMin) * 0.3
    pen = TTGlyphPen(None)
    for left in (play.xMin + width * 0.08, play.xMax - width * 0.08 - bar):
        pen.moveTo((round(left), play.yMin))
        pen.lineTo((round(left), play.yMax))
        pen.lineTo((round(left + bar), play.yMax))
        pen.lineTo((round(left + bar), play.yMin))
        pen.closePath()
    name = "uni23F8"
    font.setGlyphOrder(font.getGlyphOrder() + [name])
    glyphs[name] = pen.glyph()
    font["hmtx"][name] = (font["hmtx"][cmap[0x25B6]][0], round(play.xMin + width * 0.08))
    for table in font["cmap"].tables:
        if table.isUnicode():
            table.cmap[0x23F8] = name


def tabular_digits(font):
    cmap, swap = font.getBestCmap(), {}
    gsub = font["GSUB"].table
    for record in gsub.FeatureList.FeatureRecord:
        if record.FeatureTag == "tnum":
            for index in record.Feature.LookupListIndex:
                for table in gsub.LookupList.Lookup[index].SubTable:
                    swap.update(getattr(table, "ExtSubTable", table).mapping)
    for table in font["cmap"].tables:
        if table.isUnicode():
            for code in [ord(c) for c in "0123456789.,+-−×"]:
                if table.cmap.get(code) in swap:
                    table.cmap[code] = swap[table.cmap[code]]


def main(folder):
    for weight in ("Regular", "SemiBold"):
        font = TTFont(f"{folder}/Inter-{weight}.woff2")
        font.flavor = None
        tabular_digits(font)
        options = subset.Options(layout_features=["kern"], hinting=False, name_IDs=[0, 1, 2, 3, 4, 5, 6, 13, 14], notdef_outline=True)
        subsetter = subset.Subsetter(options)
        subsetter.populate(unicodes=TEXT)
        missing = [chr(c) for c in TEXT if c not in font.getBestCmap()]
        subsetter.subset(font)
        pause_glyph(font)
        for name in font["name"].names:
            if name.nameID in (1, 3, 4, 6):
                name.string = {1: "Inter Tabular", 3: f"InterTabular-{weight}", 4: f"Inter Tabular {weight}", 6: f"InterTabular-{weight}"}[name.nameID]
        font.save(f"InterTabular-{weight}.ttf")
        print(weight, "without", "".join(missing))


main(sys.argv[1])
