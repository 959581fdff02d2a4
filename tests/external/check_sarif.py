"""Holds SARIF logs (file names) against the schema of SARIF 2.1.0. Needs jsonschema."""

import json
import pathlib
import sys

from jsonschema import Draft4Validator

schema = json.loads((pathlib.Path(__file__).parent / "sarif" / "sarif-2.1.0-rtm.5.json").read_text())
Draft4Validator.check_schema(schema)
validator = Draft4Validator(schema, format_checker=Draft4Validator.FORMAT_CHECKER)
broken = {"version": "2.1.0", "runs": [{"tool": {"driver": {}}}]}
assert not validator.is_valid(broken), "a driver without a name must not pass"
for name in sys.argv[1:]:
    log = json.loads(pathlib.Path(name).read_text())
    faults = [f"{'/'.join(map(str, e.absolute_path))}: {e.message}" for e in validator.iter_errors(log)]
    assert not faults, f"{name}:\n" + "\n".join(faults)
    print(f"{name}: valid, {len(log['runs'][0]['results'])} results")
