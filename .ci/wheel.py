#!/usr/bin/env python3
"""Packs the Python package with a module that cargo has built: `.ci/wheel.py LIBRARY FOLDER`. Prints the path of the wheel.

`maturin build` makes the wheels of releases. It compiles the module on its own, with other features than `cargo test --workspace`, which
would compile the packages of this repository twice in `.ci/run`. Metadata are those of `crates/artgs-python/pyproject.toml`.
"""

import base64
import hashlib
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "crates/artgs-python"


def metadata(project, version):
    lines = ["Metadata-Version: 2.4", f"Name: {project['name']}", f"Version: {version}", f"Summary: {project['description']}"]
    lines += [f"Requires-Python: {project['requires-python']}", f"License-Expression: {project['license']}"]
    lines += [f"Requires-Dist: {need}" for need in project["dependencies"]]
    for extra, needs in project["optional-dependencies"].items():
        lines += [f"Provides-Extra: {extra}", *(f"Requires-Dist: {need} ; extra == '{extra}'" for need in needs)]
    return "\n".join([*lines, "Description-Content-Type: text/markdown", "", (PACKAGE / project["readme"]).read_text()])


def main():
    library, folder = map(Path, sys.argv[1:])
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["project"]
    version = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    tag = f"cp310-abi3-{platform}"
    info = f"artgs-{version}.dist-info"
    files = {f"artgs/{p.name}": p.read_bytes() for p in sorted((PACKAGE / "python/artgs").iterdir()) if p.is_file()}
    files["artgs/_native.abi3.so"] = library.read_bytes()
    files[f"{info}/METADATA"] = metadata(project, version).encode()
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: artgs\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    scripts = "\n".join(f"{name} = {target}" for name, target in project["scripts"].items())
    files[f"{info}/entry_points.txt"] = f"[console_scripts]\n{scripts}\n".encode()

    def recorded(name, data):
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        return f"{name},sha256={digest},{len(data)}"

    record = [recorded(name, data) for name, data in files.items()] + [f"{info}/RECORD,,"]
    files[f"{info}/RECORD"] = ("\n".join(record) + "\n").encode()
    folder.mkdir(parents=True, exist_ok=True)
    wheel = folder / f"artgs-{version}-{tag}.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_STORED) as packed:
        for name, data in files.items():
            packed.writestr(name, data)
    print(wheel)


if __name__ == "__main__":
    main()
