"""Makes thin_film_table.cpp: the Fourier transform of the colour matching functions by optical path difference.

    python3 make_thin_film_table.py > thin_film_table.cpp

[Belcour & Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence"]: the eye
sees a reflectance that oscillates with the wave number through this transform. First the CIE 1931 observer at 5 nm,
linear between, each channel 1 at a path difference of 0. Then the sums of Gaussians of the paper's supplement, X, Y and
Z each about 1 there and made the white of Rec.709.
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


def fitted(path: np.ndarray) -> np.ndarray:
    """Transform of Gaussians over the wave number: again Gaussians, of which Z and Y have one, X two."""
    phase = 2.0 * np.pi * path[:, None] * 1e-9
    bell = {
        "height": np.array([5.4856e-13, 4.4201e-13, 5.2481e-13, 9.7470e-14]),
        "middle": np.array([1.6810e6, 1.7953e6, 2.2084e6, 2.2399e6]),
        "variance": np.array([4.3278e9, 9.3046e9, 6.6121e9, 4.5282e9]),
    }
    size = bell["height"] * np.sqrt(2.0 * np.pi * bell["variance"]) * np.exp(-(phase**2) * bell["variance"])
    parts = size * np.exp(-1j * phase * bell["middle"]) / 1.0685e-7
    xyz = parts[:, :3] + np.outer(parts[:, 3], [1, 0, 0])
    return xyz * [0.95047, 1.0, 1.08883] @ XYZ_TO_REC709.T


def main() -> None:
    nm = np.arange(380.0, 780.0, 0.25)
    xyz = observer()
    rgb = np.stack([np.interp(nm, np.arange(380, 781, 5), xyz[:, k]) for k in range(3)], -1) @ XYZ_TO_REC709.T
    rgb /= rgb.sum(0)
    path = np.linspace(0.0, LONGEST, NODES)
    transform = np.exp(-2j * np.pi * path[:, None] / nm) @ rgb
    print("// Made by make_thin_film_table.py: change that, not this.\n// clang-format off")
    print('#include "closure/thin_film.h"\n\nnamespace talbot {\n')
    print("const float kThinFilm[12 * kThinFilmNodes] = {")
    fit = fitted(path)
    for channel in (*transform.real.T, *transform.imag.T, *fit.real.T, *fit.imag.T):
        flat = [f"{value:.5f}f" for value in channel]
        for i in range(0, NODES, 24):
            print("    " + ", ".join(flat[i : i + 24]) + ",")
    print("};\n\n}  // namespace talbot")


if __name__ == "__main__":
    main()
