"""The wheel that pip builds: what it holds, and what is said where something is missing."""

import importlib.util
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
import unittest.mock
import zipfile

import metastable
from support import data

folder = data.parents[2] / "reports" / "python"
sys.dont_write_bytecode = True
spec = importlib.util.spec_from_file_location("build_module", folder / "build_module.py")
backend = importlib.util.module_from_spec(spec)
spec.loader.exec_module(backend)


class Wheels(unittest.TestCase):
    def test_hold_the_package_of_a_build_that_is_there(self):
        built = pathlib.Path(metastable.__file__).parents[3]
        if not (built / "CMakeCache.txt").is_file():
            built = built.parent
        with tempfile.TemporaryDirectory() as made, \
                unittest.mock.patch.dict(os.environ, {"METASTABLE_BUILD_DIR": str(built)}):
            with unittest.mock.patch.object(backend, "fits", lambda where: True):  # whatever its type of build
                name = backend.build_wheel(made)
            self.assertTrue(name.startswith(f"metastable-{backend.version()}-cp3"))
            with zipfile.ZipFile(pathlib.Path(made, name)) as wheel:
                held = wheel.namelist()
                record = wheel.read(f"{backend.info()}/RECORD").decode()
                wheel.extractall(pathlib.Path(made, "out"))
            self.assertEqual(len(record.splitlines()), len(held))
            for module in folder.joinpath("metastable").glob("*.py*"):
                self.assertIn(f"metastable/{module.name}", held)
            told = subprocess.run([sys.executable, "-c", "import metastable; print(metastable.__file__)"], text=True,
                                  capture_output=True, env={**os.environ, "PYTHONPATH": str(pathlib.Path(made, "out"))})
            self.assertEqual(told.stdout.strip(), str(pathlib.Path(made, "out", "metastable", "__init__.py")), told.stderr)

    def test_are_refused_in_one_sentence_where_something_is_missing(self):
        def tools(**there):
            return unittest.mock.patch.object(backend.shutil, "which", lambda name: there.get(name))

        with tempfile.TemporaryDirectory() as made:
            for which, sentence in (({}, "^metastable: CMake is missing: install cmake"),
                                    (dict(cmake="/usr/bin/cmake"), "^metastable: A build program is missing"),
                                    (dict(cmake="/usr/bin/cmake", ninja="/usr/bin/ninja"),
                                     r"^metastable: (A C\+\+ compiler is missing|The C\+\+ compiler .* is missing)")):
                with self.subTest(sentence), tools(**which), self.assertRaisesRegex(SystemExit, sentence) as raised:
                    backend.build_wheel(made)
                self.assertEqual(str(raised.exception).count("\n"), 0)
            with unittest.mock.patch.object(backend, "of_python", lambda program: None), \
                    self.assertRaisesRegex(SystemExit, "^metastable: NumPy is missing in "):
                backend.prepare_metadata_for_build_wheel(made)
            self.assertEqual(os.listdir(made), [])

    def test_name_the_library_that_cmake_does_not_find(self):
        for told, sentence in (('  asked CMake to find a package configuration file provided by\n  "Eigen3", but',
                                "Eigen3 is missing: install it (Debian: apt install libeigen3-dev)."),
                               ("-- Could NOT find KLU (missing: KLU_LIBRARY)",
                                "KLU is missing: install it (Debian: apt install libsuitesparse-dev)."),
                               ('package configuration file provided by "pybind11" (requested',
                                "pybind11 is missing: install it (Debian: apt install pybind11-dev)."),
                               ("CMake Error at CMakeLists.txt:2:\n  something else\n  is wrong\n\n",
                                "CMake cannot configure the build: something else is wrong")):
            self.assertEqual(backend.missing_of(told), sentence)

    def test_take_no_build_of_another_python_or_of_other_sources(self):
        with tempfile.TemporaryDirectory() as made:
            module = pathlib.Path(made, "reports", "python", "metastable")
            module.mkdir(parents=True)
            cache = pathlib.Path(made, "CMakeCache.txt")
            suffix = backend.sysconfig.get_config_var("EXT_SUFFIX")
            for name, sources, kind, fits in (("_metastable" + suffix, backend.root, "Release", True),
                                              ("_metastable" + suffix, backend.root, "Debug", False),
                                              ("_metastable" + suffix, "/elsewhere", "Release", False),
                                              ("_metastable.cpython-27.so", backend.root, "Release", False)):
                cache.write_text(f"CMAKE_HOME_DIRECTORY:INTERNAL={sources}\nCMAKE_BUILD_TYPE:STRING={kind}\n")
                (module / name).touch()
                self.assertEqual(backend.fits(made), fits, (name, sources, kind))
                (module / name).unlink()
            self.assertFalse(backend.fits(pathlib.Path(made, "nowhere")))


if __name__ == "__main__":
    unittest.main()
