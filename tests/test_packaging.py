"""What is installed: one package, ``tilestamp``, with all its data, whichever way it came."""

import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

import tilestamp

ROOT = Path(__file__).parent.parent
FLOORS = ("models", "simulator", "experiments", "reports")
GALLERY = "reports/gallery/"
BUILD = "import sys, setuptools.build_meta as b; getattr(b, sys.argv[1])(sys.argv[2])"
METADATA = f"tilestamp-{tilestamp.__version__}.dist-info"
KINDS = ("wheel", "wheel of the sdist", "editable")
FREE = "import importlib.util as u, sys; print([name for name in sys.argv[1:] if u.find_spec(name)])"


def command(*arguments: object, cwd: Path) -> str:
    """Run something; give what it printed."""
    done = subprocess.run(list(map(str, arguments)), cwd=cwd, check=False, capture_output=True, text=True)  # noqa: S603 - our own
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def tracked() -> list[str]:
    """Files that git tracks."""
    if not (ROOT / ".git").exists():
        pytest.skip("no git checkout: what it tracks is not known")
    return command("git", "ls-files", "-z", cwd=ROOT).rstrip("\0").split("\0")


@pytest.fixture(scope="module")
def checkout(tracked, tmp_path_factory) -> Path:
    """Give a copy of the tracked files, links as links."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in tracked:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name, follow_symlinks=False)
    return folder


@pytest.fixture(scope="module")
def wheels(checkout, tmp_path_factory) -> dict[str, Path]:
    """Build a wheel of the checkout, and one of its sdist."""
    folder = tmp_path_factory.mktemp("dist")
    command(sys.executable, "-c", BUILD, "build_wheel", folder / "wheel", cwd=checkout)
    command(sys.executable, "-c", BUILD, "build_sdist", folder, cwd=checkout)
    shutil.unpack_archive(next(folder.glob("*.tar.gz")), folder / "sdist", filter="data")
    command(sys.executable, "-c", BUILD, "build_wheel", folder / "again", cwd=next((folder / "sdist").iterdir()))
    return {KINDS[0]: next((folder / "wheel").iterdir()), KINDS[1]: next((folder / "again").iterdir())}


@pytest.fixture(scope="module", params=KINDS)
def installed(request, checkout, wheels, tmp_path_factory) -> Path:
    """Give an environment that sees our dependencies, with tilestamp installed in one of the ways."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False, symlinks=True)
    site = next(folder.glob("lib/python*/site-packages"))
    (site / "dependencies.pth").write_text("\n".join(path for path in sys.path if "site-packages" in path))
    what = [wheels[request.param]] if request.param in wheels else ["--editable", checkout]
    pip = [sys.executable, "-m", "pip", "--python", folder / "bin" / "python", "install", "--quiet", "--no-deps"]
    command(*pip, "--no-index", "--no-build-isolation", *what, cwd=folder)
    return folder


@pytest.fixture
def users_folder(tmp_path) -> Path:
    """Give a folder with packages and a module of the user's own that bear the floors' names."""
    for name in FLOORS[:3]:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise RuntimeError('the user has this, not tilestamp')")
    (tmp_path / "reports.py").write_text("raise RuntimeError('the user has this, not tilestamp')")
    return tmp_path


def names(wheel: Path) -> set[str]:
    return {name for name in zipfile.ZipFile(wheel).namelist() if not name.endswith("/")}


def test_a_wheel_holds_every_tracked_file_of_the_floors_but_the_gallery(wheels, tracked):
    wanted = {f"tilestamp/{n}" for n in tracked if n.startswith(FLOORS) and not n.startswith(GALLERY)}
    assert len(wanted) > 300
    assert wanted <= names(wheels["wheel"])


def test_a_wheel_leaves_the_gallery_out_and_claims_one_name(wheels):
    held = names(wheels["wheel"])
    assert {name.split("/")[0] for name in held} == {"tilestamp", METADATA}
    assert not [name for name in held if "gallery" in name or "__pycache__" in name]


def test_the_wheel_of_an_sdist_holds_the_same(wheels):
    assert names(wheels["wheel of the sdist"]) == names(wheels["wheel"])


def test_site_packages_gets_tilestamp_and_nothing_else(installed, tmp_path):
    site = next(installed.glob("lib/python*/site-packages"))
    found = {path.name for path in site.iterdir()} - {"dependencies.pth", "__pycache__"}
    assert {name for name in found if not name.startswith("__editable__")} <= {"tilestamp", METADATA}
    assert command(installed / "bin" / "python", "-c", FREE, *FLOORS, cwd=tmp_path).strip() == "[]"


def test_it_works_beside_the_users_own_packages(installed, users_folder):
    run = [installed / "bin" / "tilestamp", "render", "teapot", "--pipeline", "hardware", "--machine", "gtx480"]
    assert "ms" in command(*run, "--size", "32x24", cwd=users_folder)
    listed = command(installed / "bin" / "python", "-m", "tilestamp", "list", "experiments", cwd=users_folder)
    assert "eisenacher2010/table3" in listed


def test_both_commands_give_the_version(installed, users_folder):
    assert command(installed / "bin" / "tilestamp", "--version", cwd=users_folder).strip() == tilestamp.__version__
    python = installed / "bin" / "python"
    assert command(python, "-m", "tilestamp", "--version", cwd=users_folder).strip() == tilestamp.__version__


def test_dir_is_the_public_list():
    assert dir(tilestamp) == sorted([*tilestamp.__all__, "__version__"])
    assert all(getattr(tilestamp, name) is not None for name in tilestamp.__all__)
