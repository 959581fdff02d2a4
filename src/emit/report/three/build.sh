#!/usr/bin/env bash
# Makes `three.min.js` anew from the pinned packages. Needs node and npm; building Flexura needs neither.
set -euo pipefail
cd "$(dirname "$0")"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp package.json package-lock.json entry.mjs "$work/"
(cd "$work" && npm ci --silent --no-audit --no-fund)
(cd "$work" && npx esbuild entry.mjs --bundle --minify --format=iife --global-name=THREE --target=es2020 \
    --legal-comments=inline --log-level=warning --outfile=three.min.js)
cp "$work/three.min.js" "$work/node_modules/three/LICENSE" .
# It stands inside of a page: nothing in it may end the script.
! grep -qi '</script\|<!--' three.min.js
ls -l three.min.js
