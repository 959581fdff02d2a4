#!/usr/bin/env bash
# The language server through Neovim: editor.sh FLEXURA. Prints a transcript; fails at the first wrong answer.
set -euo pipefail
server=$(realpath "$1")
root=$(cd "$(dirname "$0")/../.." && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cp "$root"/examples/hand/{finger,hand}.{mech,lock} "$folder/"
sed -e 's/point O = (0 mm, 0 mm)$/point O = (0 mm, 0 mm/' -e 's/over 2 s$/over 2 mm/' \
    "$root/examples/chebyshev/chebyshev.mech" >"$folder/broken.mech"
cd "$folder"
FLEXURA=$server FOLDER=$folder XDG_CACHE_HOME=$folder/cache HOME=$folder \
    timeout 120 nvim --headless -u NONE -n -c "luafile $root/tests/external/editor.lua"
