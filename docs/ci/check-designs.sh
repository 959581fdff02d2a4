#!/bin/sh
# What a build server asks of the designs of a repository: no errors, locks that belong to them, requirements that hold.
# Reports go into the folder `reports`: findings as SARIF, a file a design, and the tests as JUnit.
set -eu
mkdir -p reports
git -c core.quotePath=false ls-files -- '*.mech' >reports/designs.txt
status=0
number=0
while IFS= read -r design; do
    grep -q '^mechanism' "$design" || continue
    number=$((number + 1))
    flexura check "$design" --format sarif >"reports/$number.sarif" || status=1
done <reports/designs.txt
flexura test . --format junit >reports/flexura.xml || status=1
[ "$status" = 0 ] || flexura test . || true
exit "$status"
