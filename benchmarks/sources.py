"""Sources of the recordings of others, and how to fetch them: ``python -m benchmarks.sources``.

They are not part of this project: some of their authors state no licence. The command prints what
fetches them; nothing is downloaded. The page adds the checksums of the tidy files that the
benchmarks read from ``PALPATE_DATA``, or from ``../shared/data`` next to the checkout.
"""

import hashlib
import shlex
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

from benchmarks.common.recordings import recorded
from benchmarks.common.report import markdown_table, run_command, show


@dataclass(frozen=True, slots=True)
class Source:
    """Recordings of one repository: ``files`` of ours by pattern, and the author's file of each.

    ``made`` says how the tidy file follows from it: SI units, penetration and force positive into
    the material, time in seconds.
    """

    what: str
    repository: str
    commit: str
    licence: str
    files: dict[str, str]
    made: str


SOURCES = (
    Source(
        "A: a lever indents a soft specimen, 2 kHz",
        "SDAMcIntyre/Indentation_Discrimination",
        "df7c7a328281bbe81ba5e99898b4f13f35592544",
        "MIT",
        {
            f"A_aurora_220118_{force}mN": f"Emma protocols/22-01-18/{force} mN data file.ddf"
            for force in (100, 250, 600, 1000)
        },
        "1 mm and 500 mN a volt; surface: the median position 60 to 10 ms before the ramp",
    ),
    Source(
        "A: the same lever, automatic series",
        "SDAMcIntyre/Indentation_Discrimination",
        "db4568842237c1b4a2ef3ef9998d07947277e7f5",
        "MIT",
        {
            f"A_aurora_auto_{force}_1": f"Emma protocols/Aurora auto save/--{force}_1.ddf"
            for force in (70, 140, 200)
        },
        "as above; surface: the last upward crossing of 5 mN",
    ),
    Source(
        "B: heels of walking people, force 3 kHz, position 1.3 kHz",
        "PMBaines/ExperimentalData_EnergyAbsorptionDuringHeelStrike",
        "54baab96e9da3a8cd43733723809b29c09d4d8bd",
        "MIT",
        {
            f"B_heel_subject{subject:02}": f"{subject}/TN*.gai, {subject}/TN*.ndf"
            for subject in (2, 5, 8, 9, 12, 13)
        },
        "vertical force by the subject's 25.01 kg weight; the heel is fixed to the markers on the "
        "shank at the centre of pressure; height interpolated to 3 kHz; a segment is a step",
    ),
    Source(
        "C: cyclic compression of printed TPU, 1 Hz, sampled at 100 Hz",
        "mev43/FYP-Cyclic-Compression-Data-Analysis",
        "6e9da5a40287a98ddb13696913084ff2512c3afc",
        "none stated",
        {
            f"C_tpu_{name}": f"{folder}/Test1/Test1.steps.tracking.csv"
            for name, folder in {
                "87-20_wk0": "0 WK/20250905 87-20",
                "90-50_wk0": "0 WK/20250905 90-50",
                "95-20_wk2": "2 WK Repeats/20250908 95-20",
            }.items()
        },
        "step 3; rows that repeat a time dropped; surface: the 99.8th percentile of the position "
        "in the first 600 samples; a segment is a block of cycles",
    ),
    Source(
        "D: a da Vinci robot palpates a phantom, 66 Hz",
        "vu-arma-dev/robot-palpation-data",
        "13aef0c2cefcf893ef3b9e90ffbaa76ed4cda918",
        "none stated",
        {
            f"D_dvrk_{pattern}": f"Data_original/continuous_palpitation/palpation/{name}.mat"
            for pattern, name in {
                "palpation_trial3_*": "ContPalpTrial3",
                "palpation_trial4_*": "ContPalpTrial4",
                "trial4_raw_*": "ContPalpTrial4",
                "RAL18T1_full_raw": "ContPalpRAL18T1",
            }.items()
        },
        "palpation: 3 to 5 s at one spot, projected on the mean direction of the force, surface at "
        "the lowest position; raw: the whole recording",
    ),
    Source(
        "E: force–distance curves of an atomic force microscope, 1 to 5 kHz",
        "AFM-analysis/afmformats",
        "731b5ad88bbb99b2455694d29016acd85a731388",
        "MIT",
        {
            f"E_afm_{name}": f"tests/data/{file}"
            for name, file in {
                "brain_creep": "fmt-jpk-cc_pr14-brain-2021.06.30.jpk-force",
                "h5example": "fmt-hdf5-fd_version_0.13.3.h5",
                "refpoints_c0": "fmt-jpk-fd_map-data-reference-points.jpk-force-map",
            }.items()
        },
        "force less the median of the first 40 % of the approach; penetration is the height "
        "less the cantilever's deflection; surface: the last sample of the approach within four "
        "standard deviations of the noise",
    ),
    Source(
        "E: the same kind of curves",
        "AFM-analysis/nanite",
        "77636ddf2b1e6d0e748dc04d6f47bee5257cec63",
        "GPL-3.0 (of the repository)",
        {
            "E_afm_kvm_5kHz": "tests/data/fmt-jpk-fd_KVM_5um_sec_B-2018-08-02.jpk-force",
            "E_afm_zebrafish_gray": "examples/data/zebrafish-head-section-gray-matter.jpk-force",
        },
        "as above",
    ),
    Source(
        "F: microrheology by an atomic force microscope, sines of 1 to 300 Hz",
        "jlopezalo/PyFMReader",
        "b48c41cf7378982057639534f27b05abc206af56",
        "MIT",
        {"F_microrheo_*": "tests/testfiles/map-data-2021.11.05-17.37.44.432.jpk-force-map"},
        "curves 0 and 10; the time between segments is taken as zero",
    ),
    Source(
        "G: a robot presses silicone, 500 Hz (Beber et al., arXiv 2404.09542)",
        "lucabeber/kalman",
        "94d214c3",
        "none stated for the data",
        {
            f"G_silicone_{name}": f"simulation_data_{name}.csv"
            for name in ("soft", "hard", "d10mm_soft", "d10mm_horse", "d10mm_sphere")
        },
        "columns position, command, penetration (the authors' zero), velocity, in mm; force; 2 ms "
        "a row; recorded, in spite of the name",
    ),
)
WHY = (
    "Where do the recordings come from that these pages name by a letter, A to G? From public "
    "repositories of their authors, at the commit of the table. They are not part of this "
    "project. `python -m benchmarks.sources` prints the commands that fetch them."
)
TIDY = (
    "The benchmarks read tidy files of them: CSV with `time_s`, `penetration_m`, `force_N` and the "
    "position as recorded. Nothing is filtered. The checksums are those of the tidy files that "
    "these pages measured."
)


def main(markdown: Path | None = None) -> None:
    """Print how to fetch the recordings of others.

    Parameters
    ----------
    markdown
        Write the page to this file.
    """
    if markdown is None:
        print("\n".join(commands()))
        return
    sums = {path.stem: hashlib.sha256(path.read_bytes()).hexdigest() for path in recorded()}
    lines = [WHY, "", TIDY, ""]
    for source in SOURCES:
        address = f"[{source.repository}](https://github.com/{source.repository})"
        about = (
            f"{address}, commit `{source.commit}`, licence: {source.licence}. Made: {source.made}."
        )
        rows = [
            [f"`{name}`", f"`{theirs}`", f"`{checksum}`"]
            for pattern, theirs in source.files.items()
            for name, checksum in sums.items()
            if fnmatch(name, pattern)
        ]
        header = ("recording", "the authors' file", "SHA-256 of the tidy file")
        lines += [f"## {source.what}", "", about, "", *markdown_table(header, rows), ""]
    show(lines, "Sources of the recordings", markdown)


def commands() -> list[str]:
    """Return the commands that fetch the authors' files, at their commits."""
    lines = []
    for source in SOURCES:
        folder = f"sources/{source.repository.partition('/')[2]}-{source.commit[:8]}"
        files = sorted({f for each in source.files.values() for f in each.split(", ")})
        address = f"https://github.com/{source.repository}"
        lines += [
            f"# {source.what}; licence: {source.licence}",
            f"git clone --filter=blob:none --no-checkout {address} {folder}",
            f"git -C {folder} checkout {source.commit} -- {shlex.join(files)}",
        ]
    return lines


if __name__ == "__main__":
    run_command(main)
