#!/usr/bin/env bash
# Compiles the parser and puts it with its queries where an editor looks: install.sh neovim|helix [FOLDER]. Needs a C compiler.
set -euo pipefail
source=$(cd "$(dirname "$0")" && pwd)
config=${XDG_CONFIG_HOME:-$HOME/.config}
case ${1:-} in
    neovim) folder=${2:-$config/nvim} parser=parser queries=queries/flexura ;;
    helix) folder=${2:-$config/helix/runtime} parser=grammars queries=queries/mech ;;
    *) printf 'install.sh neovim|helix [FOLDER]\n' >&2; exit 2 ;;
esac
mkdir -p "$folder/$parser" "$folder/$queries"
"${CC:-cc}" -shared -fPIC -O2 -I "$source/src" -o "$folder/$parser/flexura.so" "$source"/src/{parser,scanner}.c
cp "$source"/queries/*.scm "$folder/$queries/"
printf '%s\n' "$folder/$parser/flexura.so" "$folder/$queries/"
