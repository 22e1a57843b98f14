"""Work for the tests: results that were made beforehand, in the place of trainings."""

import shutil
from pathlib import Path


def measure(folder, progress, config, tables, runs, known_runs=None):
    """Take the prepared results; fails where there are none."""
    progress(0.0, "training")
    print(f"<script>alert('{config['model']}')</script>")
    for table in tables:
        prepared = Path(folder).parent / "prepared" / Path(table["result"]).relative_to("results")
        if not prepared.is_file():
            raise ValueError(f"<b>no {config['model']}</b> & nothing else")
        target = folder / table["result"]
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(prepared, target)
