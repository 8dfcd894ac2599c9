"""The files of a campaign, as ``template`` writes them."""

import io
from contextlib import redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory

from extension.tables import block
from pipeline import template


def text() -> str:
    """Return what explains the tables, and the machine with every key explained."""
    with TemporaryDirectory() as folder, redirect_stdout(io.StringIO()):
        template.run([f"output={folder}/campaign"])
        readme, machine = ((Path(folder) / "campaign" / name).read_text() for name in ("README.txt", "machine.yaml"))
    return f"### machine.yaml\n\n{block(machine, 'yaml')}\n### Tables\n\n{block(readme)}"
