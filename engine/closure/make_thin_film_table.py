"""Makes thin_film_table.cpp: the Fourier transform of the colour matching functions by optical path difference.

    python3 make_thin_film_table.py > thin_film_table.cpp

[Belcour & Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence"]: the eye
sees a reflectance that oscillates with the wave number through this transform. The CIE 1931 observer at 5 nm, linear
between; each channel is 1 at a path difference of 0.
"""

import re
from pathlib import Path

import numpy as np

NODES, LONGEST = 768, 9600.0
XYZ_TO_REC709 = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)


def observer() -> np.ndarray:
    """The rows of 380 to 780 nm that the Wavelength node has."""
    source = (Path(__file__).parent.parent / "shader" / "spectra.cpp").read_text()
    table = source[source.index("kObserver[kSteps][3] = {") : source.index("}};")]
    rows = re.findall(r"\{([\d.]+)f, ([\d.]+)f, ([\d.]+)f\}?", table + "}")
    assert len(rows) == 81
    return np.array(rows, dtype=float)


def main() -> None:
    nm = np.arange(380.0, 780.0, 0.25)
    xyz = observer()
    rgb = np.stack([np.interp(nm, np.arange(380, 781, 5), xyz[:, k]) for k in range(3)], -1) @ XYZ_TO_REC709.T
    rgb /= rgb.sum(0)
    path = np.linspace(0.0, LONGEST, NODES)
    transform = np.exp(-2j * np.pi * path[:, None] / nm) @ rgb
    print("// Made by make_thin_film_table.py: change that, not this.\n// clang-format off")
    print('#include "closure/thin_film.h"\n\nnamespace talbot {\n')
    print("const float kThinFilm[6 * kThinFilmNodes] = {")
    for channel in (*transform.real.T, *transform.imag.T):
        flat = [f"{value:.5f}f" for value in channel]
        for i in range(0, NODES, 24):
            print("    " + ", ".join(flat[i : i + 24]) + ",")
    print("};\n\n}  // namespace talbot")


if __name__ == "__main__":
    main()
