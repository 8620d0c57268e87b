"""What an installed package must be."""

from __future__ import annotations

import importlib
import importlib.metadata
import shutil
import subprocess
from pathlib import Path

import pytest

import cairn


def test_version_is_the_librarys() -> None:
    assert importlib.metadata.version("cairn-physics") == cairn.__version__


@pytest.mark.parametrize("module", ["cairn._bullet", "cairn._bullet64"])
def test_bullets_statics_are_not_shared_between_precisions(module: str) -> None:
    """Each module must export its own, not "unique" (u), or the precision loaded second gets the first one's."""
    nm = shutil.which("nm")
    if nm is None:
        pytest.skip("needs nm")
    path = importlib.import_module(module).__file__
    assert path is not None and Path(path).with_name("libcairn.so").exists()
    listing = subprocess.run([nm, "-D", "--defined-only", path], check=True, capture_output=True, text=True).stdout
    kinds = {name: kind for _, kind, name in (line.split() for line in listing.splitlines())}
    assert kinds["_ZZN11btTransform11getIdentityEvE17identityTransform"] in "VB"
    assert kinds["_ZZN11btMatrix3x311getIdentityEvE14identityMatrix"] in "VB"
    assert "u" not in kinds.values()
