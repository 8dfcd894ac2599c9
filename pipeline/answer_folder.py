"""Writing an answer beside its place and then moving it: a disk that fills up, or a signal, leaves what was there."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory


def write_whole(write: Callable[[Path], list[Path]], output: Path) -> list[Path]:
    """Leave files in a folder, all or none; write: puts them into the folder it is given and returns their paths."""
    with TemporaryDirectory(prefix=".writing-", dir=output) as folder:
        beside = Path(folder)
        names = [path.relative_to(beside) for path in write(beside)]
        for name in names:
            (output / name).parent.mkdir(exist_ok=True)
            (beside / name).replace(output / name)
    return [output / name for name in names]
