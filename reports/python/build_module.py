"""Builds the wheel for pip with CMake, for the Python that runs it: a build backend (PEP 517) that needs no packages."""

import base64
import hashlib
import os
import pathlib
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zipfile

here = pathlib.Path(__file__).resolve().parent
root = here.parents[1]

# Where this file was compiled to: the clone stays as it was.
if __spec__.cached:
    compiled = pathlib.Path(__spec__.cached)
    try:
        compiled.unlink()
        compiled.parent.rmdir()
    except OSError:
        pass

# What CMake calls what it looks for, and Debian's package of it.
debian = {"Boost": "libboost-dev", "Eigen3": "libeigen3-dev", "spectra": "libspectra-dev", "KLU": "libsuitesparse-dev",
          "Random123": "librandom123-dev", "fmt": "libfmt-dev", "OpenSSL": "libssl-dev", "CLI11": "libcli11-dev",
          "tomlplusplus": "libtomlplusplus-dev", "nlohmann_json": "nlohmann-json3-dev",
          "mustache": "libkainjow-mustache-dev", "pybind11": "pybind11-dev"}


class Missing(Exception):
    """One sentence about what is missing."""


def environment():
    """That of the Python that asked: pip hides its packages from builds."""
    return {name: value for name, value in os.environ.items()
            if name not in ("PYTHONPATH", "PYTHONNOUSERSITE", "PYTHONHOME")}


def of_python(program):
    """What this Python prints, or None where the program fails."""
    ran = subprocess.run([sys.executable, "-c", program], env=environment(), capture_output=True, text=True)
    return ran.stdout.strip() if ran.returncode == 0 else None


def version_of(text):
    found = re.search(r"\d+\.\d+(\.\d+)?", text or "")
    return tuple(int(part) for part in found.group().split(".")) if found else (0,)


def require_tools():
    """Raises Missing for the first thing that is not there. Libraries of C++ are looked for by CMake."""
    if not (root / "CMakeLists.txt").is_file():
        raise Missing(f"metastable is built from its whole source tree, of which {here} is reports/python: "
                      "install it from there, with pip 21.3 or later.")
    if not shutil.which("cmake"):
        raise Missing("CMake is missing: install cmake 3.25 or later (Debian: apt install cmake).")
    told = subprocess.run(["cmake", "--version"], capture_output=True, text=True).stdout
    if version_of(told) < (3, 25):
        raise Missing(f"CMake 3.25 or later is needed, and {shutil.which('cmake')} is {told.split()[2]}.")
    if not shutil.which("ninja") and not shutil.which("make"):
        raise Missing("A build program is missing: install ninja or make (Debian: apt install ninja-build).")
    compiler = os.environ.get("CXX", "").split()
    if compiler and not shutil.which(compiler[0]):
        raise Missing(f"The C++ compiler {compiler[0]} that CXX names is missing.")
    if not compiler and not any(shutil.which(name) for name in ("c++", "g++", "clang++")):
        raise Missing("A C++ compiler is missing: install one of C++20 (Debian: apt install g++).")
    headers = sysconfig.get_path("include")
    if not pathlib.Path(headers, "Python.h").is_file():
        raise Missing(f"The headers of {sys.executable} are missing: {headers} holds no Python.h (Debian: apt install "
                      "python3-dev).")
    if of_python("import numpy") is None:
        raise Missing(f"NumPy is missing in {sys.executable}: install it there (pip install numpy), or make the "
                      "environment with --system-site-packages where Debian's python3-numpy is.")


def pybind11_folder():
    """CMake's folder of the pybind11 that this Python has; None where it has none, and CMake looks for Debian's."""
    return of_python("import pybind11; print(pybind11.get_cmake_dir())")


def numpy_fits(pybind11_version):
    """Raises Missing where both are there and do not fit."""
    numpy = of_python("import numpy; print(numpy.__version__)")
    if version_of(numpy) >= (2,) and version_of(pybind11_version) < (2, 12):
        raise Missing(f"NumPy {numpy} needs pybind11 2.12 or later, and {pybind11_version} was found: pip install "
                      "pybind11, or an older NumPy.")
    if sys.version_info >= (3, 12) and version_of(pybind11_version) < (2, 11):
        raise Missing(f"Python {sys.version_info[0]}.{sys.version_info[1]} needs pybind11 2.11 or later, and "
                      f"{pybind11_version} was found: pip install pybind11.")


def cached(folder):
    """What CMake was told in a build folder; empty where there is none."""
    cache = pathlib.Path(folder, "CMakeCache.txt")
    lines = cache.read_text().splitlines() if cache.is_file() else []
    return {name: value for name, value in re.findall(r"^([\w-]+)(?::\w+)?=(.*)$", "\n".join(lines), re.M)}


def fits(folder):
    """Whether a build folder is of these sources, optimised, and of a Python that loads the same modules."""
    told = cached(folder)
    if not told or pathlib.Path(told.get("CMAKE_HOME_DIRECTORY", "/nowhere")).resolve() != root:
        return False
    if told.get("CMAKE_BUILD_TYPE") != "Release" or told.get("METASTABLE_PYTHON") == "OFF":
        return False
    if told.get("METASTABLE_SANITIZE") or told.get("METASTABLE_COVERAGE") == "ON":
        return False
    modules = list(pathlib.Path(folder, "reports/python/metastable").glob("_metastable*"))
    return [module.name for module in modules] == ["_metastable" + sysconfig.get_config_var("EXT_SUFFIX")]


def missing_of(output):
    """A sentence about what CMake did not find."""
    names = re.findall(r"Could NOT find (\w+)|configuration file provided by\s+\"(\w+)\"", output)
    for name in [one or other for one, other in names]:
        for known, package in debian.items():
            if known.lower() in name.lower():
                return f"{known} is missing: install it (Debian: apt install {package})."
    found = re.search(r"CMake Error[^\n]*\n+((?:  .*\n?)+)", output)
    return "CMake cannot configure the build: " + " ".join((found.group(1) if found else output[-500:]).split())


def run(what, *command):
    """Runs a program; its output is shown only where it fails."""
    ran = subprocess.run(command, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if ran.returncode:
        raise Missing(missing_of(ran.stdout) if what == "configure" else f"The {what} failed:\n{ran.stdout[-4000:]}")


def configure(folder):
    # Which pybind11 it will be is known before anything is compiled.
    options = ["-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_UNITY_BUILD=ON", "-DMETASTABLE_TESTS=OFF", "-DMETASTABLE_MPI=OFF",
               "-DMETASTABLE_PYTHON=ON", f"-DPython_EXECUTABLE={sys.executable}"]
    if pybind11_folder():
        options.append(f"-Dpybind11_DIR={pybind11_folder()}")
    generator = ["-G", "Ninja"] if shutil.which("ninja") else ["-G", "Unix Makefiles"]
    run("configure", "cmake", "-S", str(root), "-B", folder, *generator, *options)


def require_pybind11(folder):
    config = pathlib.Path(cached(folder).get("pybind11_DIR", "/nowhere"), "pybind11ConfigVersion.cmake")
    if config.is_file():
        numpy_fits(".".join(map(str, version_of(config.read_text()))))


def build(folder, staged):
    """Builds the module in a folder, and puts the package into another."""
    if not fits(folder):
        configure(folder)
    require_pybind11(folder)
    run("build", "cmake", "--build", folder, "--target", "metastable_python", "--parallel",
        os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL") or str(os.cpu_count() or 1))
    run("installation", "cmake", "--install", folder, "--component", "python", "--prefix", staged)
    return next(pathlib.Path(staged).rglob("metastable/__init__.py")).parent


def build_folder(settings, temporary):
    """Where it is built: where the user says; else a build of these sources that fits; else a temporary folder."""
    asked = (settings or {}).get("build-dir") or os.environ.get("METASTABLE_BUILD_DIR")
    if asked:
        return str(pathlib.Path(asked).absolute())
    usual = root / "build" / "release"
    return str(usual) if fits(usual) and os.access(usual, os.W_OK) else str(pathlib.Path(temporary, "build"))


def version():
    return re.search(r"project\(metastable VERSION ([\d.]+)", (root / "CMakeLists.txt").read_text()).group(1)


def tag():
    python = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    return f"{python}-{python}{sys.abiflags}-{re.sub(r'[-.]', '_', sysconfig.get_platform())}"


def metadata():
    project = (here / "pyproject.toml").read_text()
    summary = re.search(r'description = "(.*)"', project).group(1)
    return {"METADATA": f"Metadata-Version: 2.1\nName: metastable\nVersion: {version()}\nSummary: {summary}\n"
                        "License: MIT\nRequires-Python: >=3.9\nRequires-Dist: numpy\n",
            "WHEEL": f"Wheel-Version: 1.0\nGenerator: metastable\nRoot-Is-Purelib: false\nTag: {tag()}\n"}


def info():
    return f"metastable-{version()}.dist-info"


def told(function):
    """What is missing is said in one sentence, without a trace."""
    def telling(*arguments, **named):
        try:
            return function(*arguments, **named)
        except Missing as missing:
            sys.exit(f"metastable: {missing}")
    return telling


@told
def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    """PEP 517: refuses early where something is missing."""
    require_tools()
    folder = pathlib.Path(metadata_directory, info())
    folder.mkdir()
    for name, text in metadata().items():
        (folder / name).write_text(text)
    return folder.name


@told
def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """PEP 517. The setting build-dir, or METASTABLE_BUILD_DIR, names a build folder that is kept."""
    require_tools()
    name = f"metastable-{version()}-{tag()}.whl"
    with tempfile.TemporaryDirectory() as temporary:
        package = build(build_folder(config_settings, temporary), str(pathlib.Path(temporary, "staged")))
        files = {f"metastable/{path.name}": path.read_bytes() for path in sorted(package.iterdir()) if path.is_file()}
    files.update((f"{info()}/{name}", text.encode()) for name, text in metadata().items())
    record = ""
    with zipfile.ZipFile(pathlib.Path(wheel_directory, name), "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, content in files.items():
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            record += f"{path},sha256={digest},{len(content)}\n"
            wheel.writestr(path, content)
        wheel.writestr(f"{info()}/RECORD", record + f"{info()}/RECORD,,\n")
    return name


@told
def build_sdist(sdist_directory, config_settings=None):
    """PEP 517: there is none."""
    raise Missing("metastable has no source distribution of its own: install it from the folder reports/python of its "
                  "source tree.")
