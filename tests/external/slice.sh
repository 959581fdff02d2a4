#!/usr/bin/env bash
# slice.sh PART.stl: admesh finds nothing to mend, and PrusaSlicer slices the part without a repair.
set -euo pipefail
part=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
admesh --no-check "$part" >/dev/null
admesh "$part" >"$work/admesh"
# Every row of repairs reads "Name : 0"; degenerate facets and the like are counted there too.
for row in 'Edges fixed' 'Facets removed' 'Facets added' 'Facets reversed' 'Backwards edges' 'Degenerate facets'; do
    if ! grep -q "^$row *: *0" "$work/admesh"; then
        echo "$part: admesh: $(grep "^$row" "$work/admesh")"
        exit 1
    fi
done
# A bed on which every part fits.
HOME=$work prusa-slicer --export-gcode --bed-shape 0x0,500x0,500x500,0x500 --max-print-height 500 \
    --center 250,250 --output "$work/part.gcode" "$part" >"$work/slicer" 2>&1 ||
    { cat "$work/slicer"; exit 1; }
if grep -iE 'repair|open edge|non-manifold|error' "$work/slicer"; then
    echo "$part: PrusaSlicer had to repair it"
    exit 1
fi
HOME=$work prusa-slicer --info "$part" >"$work/info" 2>&1
grep -q '^manifold = yes' "$work/info" || { cat "$work/info"; exit 1; }
echo "$part: sliced into $(wc -l <"$work/part.gcode") lines of G-code, nothing to repair"
