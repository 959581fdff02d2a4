#!/usr/bin/env bash
# The language server through Neovim: editor.sh FLEXURA. Prints a transcript; fails at the first wrong answer.
set -euo pipefail
server=$(realpath "$1")
root=$(cd "$(dirname "$0")/../.." && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cp "$root"/examples/hand/{finger,hand}.{mech,lock} "$folder/"
sed -e 's/point O = (0 mm, 0 mm)$/point O = (0 mm, 0 mm/' -e 's/over 2 s$/over 2 mm/' -e 's/P on coupler$/P on couplerr/' \
    "$root/examples/chebyshev/chebyshev.mech" >"$folder/broken.mech"
# A design that is built in no time, of a material in another file; what there is to repair, optimise and choose better.
cat >"$folder/parts.mech" <<'EOF'
edition 1
material own {
    E  = 1500 MPa
    nu = 0.4
    strength = 50 MPa
}
EOF
cat >"$folder/flap.mech" <<'EOF'
edition 1
use "parts.mech"
use std.processes.polyjet
use std.motors.nema17
use std.flexures.leaf
use std.flexures.wire

mechanism flap {
    point O = (0 mm, 0 mm)
    point B = (-25 mm, 0 mm)
    point P = (30 mm, 0 mm)
    ground base { B, O }
    link   arm  { O, P }
    hinge bend: base to arm at O  into base toward B  into arm toward P  as leaf { thickness = free 0.8 mm in 0.6 mm .. 1.4 mm }
    material own
    print on polyjet
    cycle 8 steps over 1 s
    drive bend from 0 deg to 20 deg with nema17
    trace tip = P on arm
    minimize { stress(below = 5 MPa) }
    require max(error(tip)) <= 50 mm
    export csv, report
}
EOF
sed 's/cycle 8 steps/cycle 50000 steps/' "$folder/flap.mech" >"$folder/long.mech"
# The tree-sitter grammar as it is installed for Neovim.
"$root/editors/tree-sitter-flexura/install.sh" neovim "$folder/nvim" >/dev/null
cd "$folder"
FLEXURA=$server FOLDER=$folder XDG_CACHE_HOME=$folder/cache HOME=$folder \
    timeout 300 nvim --headless -u NONE -n -c "luafile $root/tests/external/editor.lua"
