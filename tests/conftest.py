"""What every test may ask for: the folder of real scenes and measurements that lies beside the project."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tilestamp.simulator.scenes import Scene

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line has it
SHARED_VARIABLE = "TILESTAMP_SHARED"  # names the folder where it lies elsewhere
SCENES_VARIABLE = "TILESTAMP_SCENES"  # the scene search path that users set


def shared_folder() -> Path:
    """Where the real scenes and measurements should be: beside the repository unless the environment says otherwise."""
    named = os.environ.get(SHARED_VARIABLE)
    return Path(named) if named else Path(__file__).resolve().parent.parent.parent / "shared"


def real_scenes() -> str:
    """Search path of the real scenes; empty where they are not beside the project."""
    scenes = shared_folder() / "scenes"
    folders = [scenes, *sorted(path for path in scenes.iterdir() if path.is_dir())] if scenes.is_dir() else []
    return os.pathsep.join(map(str, folders))


class SharedFolder(type(Path())):  # type: ignore[misc]  # the class of paths here
    """The folder of real scenes and measurements: whoever takes measurements that are not there is skipped."""

    def __truediv__(self, name: str) -> Path:
        """A path in it."""
        path: Path = super().__truediv__(name)
        if Path(name).parts[:1] == ("silicon",) and self == shared_folder() and not Path(self, "silicon").is_dir():
            pytest.skip(f"no folder 'silicon' in {self}: there are scenes, and no measurements on a GPU")
        return path


@pytest.fixture(scope="session")
def shared() -> Path:
    """Give the folder of real scenes and measurements; skip where it is missing."""
    folder = shared_folder()
    if not folder.is_dir():
        pytest.skip(f"no folder {folder.name!r} beside the project: set {SHARED_VARIABLE} to where the real scenes are")
    return SharedFolder(folder)


@pytest.fixture(scope="session", autouse=True)
def _scene_search_path() -> Iterator[None]:
    """Put the real scenes on the search path for the whole session, unless the caller has set one."""
    if not real_scenes() or SCENES_VARIABLE in os.environ:
        yield
        return
    os.environ[SCENES_VARIABLE] = real_scenes()
    yield
    del os.environ[SCENES_VARIABLE]


def pytest_configure(config: pytest.Config) -> None:
    """Name the tests that are small enough to run interpreted and with bounds checked."""
    config.addinivalue_line("markers", "small: quick enough with NUMBA_DISABLE_JIT=1 and with NUMBA_BOUNDSCHECK=1")


@pytest.fixture
def load(tmp_path: Path) -> "Callable[..., Scene]":
    """Write files, the last of them the scene, and load it."""
    from tilestamp.simulator.scenes import load_scene

    def loaded(name: str, content: str | bytes, **others: str | bytes) -> "Scene":
        for other, text in {**others, name: content}.items():
            path = tmp_path / other.replace("__", ".")
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_scene(tmp_path / name)

    return loaded


@pytest.fixture(autouse=True)
def _no_terminal_of_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    """Print as into a pipe: workers of pytest-xdist are given the columns of the terminal that started them."""
    monkeypatch.delenv("COLUMNS", raising=False)
