"""What a release is made from: addresses, links of the README, recipes of package managers."""

import json
import re
import runpy
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from ruamel.yaml import YAML

import palpate

ROOT = Path(__file__).parents[1]
HOME = ROOT / "distribution"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
METADATA = runpy.run_path(str(HOME / "metadata.py"))
REPOSITORY = "https://example.org/palpate"


def requirements(lines):
    """Names and specifiers, in the form of pip or of conda."""
    return {re.sub(r"\s", "", line) for line in lines}


def test_every_relative_link_of_the_readme_leads_to_a_file_and_becomes_absolute():
    text = (ROOT / "README.md").read_text("utf-8")
    paths = [each["path"] for each in METADATA["RELATIVE"].finditer(text)]
    assert len(paths) > 20
    assert all((ROOT / path.partition("#")[0]).exists() for path in paths)
    absolute = METADATA["with_absolute_links"](text, REPOSITORY, "0.1.0")
    assert not METADATA["RELATIVE"].search(absolute)
    assert f'src="{REPOSITORY}/raw/v0.1.0/docs/images/home.svg"' in absolute
    assert f"]({REPOSITORY}/blob/v0.1.0/CHANGELOG.md)" in absolute


@pytest.fixture
def checkout(tmp_path):
    """The files that state an address, in a tree of their own."""
    fields = runpy.run_path(str(HOME / "addresses.py"))["FIELDS"]
    for file in {"distribution/addresses.py", *(field[0] for field in fields)}:
        copy = tmp_path / file
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, copy)
    return tmp_path


def test_a_release_without_addresses_stops_with_one_line_and_goes_on_when_they_are_filled_in(
    checkout,
):
    command = [sys.executable, "distribution/addresses.py"]
    run = subprocess.run(command, cwd=checkout, capture_output=True, text=True, check=False)
    assert run.returncode == 1
    assert run.stderr.startswith("A release needs pyproject.toml: repository; ")
    assert run.stderr.count("\n") == 1
    filled = [*command, REPOSITORY, f"{REPOSITORY}/docs", "nobody@example.org"]
    subprocess.run(filled, cwd=checkout, check=True)
    subprocess.run(command, cwd=checkout, check=True)
    assert f'repository-code: "{REPOSITORY}"' in (checkout / "CITATION.cff").read_text("utf-8")


def test_the_conda_recipe_needs_what_the_package_needs():
    recipe = YAML(typ="safe").load((HOME / "conda/recipe.yaml").read_text("utf-8"))
    assert recipe["context"]["version"] == palpate.__version__
    run = requirements(recipe["requirements"]["run"])
    project = PROJECT["project"]
    assert run == requirements([f"python{project['requires-python']}", *project["dependencies"]])
    assert requirements(PROJECT["build-system"]["requires"]) < requirements(
        recipe["requirements"]["host"]
    )
    licences = {Path(path) for path in recipe["about"]["license_file"]}
    named = {path for pattern in project["license-files"] for path in ROOT.glob(pattern)}
    assert {ROOT / path for path in licences} == named


# What vcpkg's own functions do in a port of headers: configure, install, move the CMake package.
VCPKG = """
macro(vcpkg_cmake_configure)
  cmake_parse_arguments(given "" "SOURCE_PATH" "" ${ARGN})
  execute_process(COMMAND ${CMAKE_COMMAND} -S ${given_SOURCE_PATH} -B ${CURRENT_PACKAGES_DIR}/build
                  COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
endmacro()
macro(vcpkg_cmake_install)
  execute_process(COMMAND ${CMAKE_COMMAND} --install ${CURRENT_PACKAGES_DIR}/build
                  --prefix ${CURRENT_PACKAGES_DIR} COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
endmacro()
macro(vcpkg_cmake_config_fixup)
  cmake_parse_arguments(given "" "CONFIG_PATH" "" ${ARGN})
  if(NOT EXISTS ${CURRENT_PACKAGES_DIR}/${given_CONFIG_PATH}/palpate-config.cmake)
    message(FATAL_ERROR "no CMake package in ${given_CONFIG_PATH}")
  endif()
endmacro()
macro(vcpkg_install_copyright)
  cmake_parse_arguments(given "" "" "FILE_LIST" ${ARGN})
  file(COPY ${given_FILE_LIST} DESTINATION ${CURRENT_PACKAGES_DIR}/share/palpate)
endmacro()
include(${PORT}/portfile.cmake)
"""


@pytest.mark.long
def test_the_port_of_vcpkg_installs_headers_and_a_cmake_package(tmp_path):
    port = json.loads((HOME / "vcpkg/vcpkg.json").read_text("utf-8"))
    assert port["version"] == palpate.__version__
    if not shutil.which("cmake"):
        pytest.skip("cmake is not installed")
    script = tmp_path / "vcpkg.cmake"
    script.write_text(VCPKG, encoding="utf-8")
    places = [f"-DPORT={HOME / 'vcpkg'}", f"-DCURRENT_PACKAGES_DIR={tmp_path / 'package'}"]
    subprocess.run(["cmake", *places, "-P", script], check=True)
    assert (tmp_path / "package/include/palpate/palpate.hpp").exists()


def test_the_image_installs_extras_and_copies_folders_that_exist():
    text = (HOME / "Dockerfile").read_text("utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert len(lines) <= 15
    extras = re.search(r"whl\)\[([\w,]+)\]", text)[1].split(",")
    assert set(extras) <= PROJECT["project"]["optional-dependencies"].keys()
    copied = re.findall(r"^COPY (\w+) ", text, re.M)
    assert copied
    assert all((ROOT / folder).is_dir() for folder in copied)
    python = re.search(r"^FROM python:([\d.]+)", text, re.M)[1]
    needed = Requirement(f"python{PROJECT['project']['requires-python']}")
    assert needed.specifier.contains(python)


def test_the_headers_of_the_package_are_where_get_include_says():
    assert Path(palpate.get_include(), "palpate", "palpate.hpp").is_file()
