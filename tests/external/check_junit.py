"""Reads a JUnit report (file name) with junitparser and prints its sums as JSON. Needs junitparser."""

import json
import sys

from junitparser import Error, Failure, JUnitXml, Skipped

report = JUnitXml.fromfile(sys.argv[1])
cases = [case for suite in report for case in suite]
of = lambda kind: [c.name for c in cases if any(isinstance(r, kind) for r in c.result)]
sums = {"suites": len(list(report)), "cases": len(cases)}
sums |= {"failures": of(Failure), "errors": of(Error), "skipped": of(Skipped)}
stated = (report.tests, report.failures, report.errors, report.skipped)
counted = (len(cases), len(sums["failures"]), len(sums["errors"]), len(sums["skipped"]))
assert stated == counted, f"the report states {stated}, there are {counted}"
print(json.dumps(sums))
