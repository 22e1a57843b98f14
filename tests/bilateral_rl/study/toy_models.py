"""Work for the tests: results that were made beforehand, in the place of trainings."""

import shutil
from pathlib import Path


def measure(folder, progress, config, lesions, runs, result):
    """Take the prepared results; fails where there are none."""
    progress(0.0, "training")
    print(f"<script>alert('{config['model']}')</script>")
    prepared = Path(folder).parent / "prepared" / Path(result).relative_to("results")
    if not prepared.is_file():
        raise ValueError(f"<b>no {config['model']}</b> & nothing else")
    target = folder / result
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(prepared, target)
