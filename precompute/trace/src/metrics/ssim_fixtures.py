"""Writes ssim_fixtures.json: what scikit-image makes of picture pairs that ssim.rs builds from the same formulas.

    python3 -m venv venv && venv/bin/pip install scikit-image numpy
    venv/bin/python ssim_fixtures.py > ssim_fixtures.json

Only the numbers are stored. Every formula is in integers, so that both sides build the same bytes.
"""

import json

import numpy
import skimage
from skimage.metrics import structural_similarity

SIZES = [(11, 11), (12, 40), (37, 29), (64, 48), (160, 90)]


def noise(x, y, seed):
    """0 to 255, the same as `noise` in ssim.rs: 32-bit arithmetic that wraps."""
    mask = 0xFFFFFFFF
    value = (x * 0x9E3779B1 + y * 0x85EBCA77 + seed * 0xC2B2AE3D) & mask
    value ^= value >> 15
    value = (value * 0x2C1B3C6D) & mask
    value ^= value >> 13
    return (value >> 8) & 255


def clamp(value):
    return max(0, min(255, value))


def build(name, width, height):
    pixels = numpy.zeros((height, width, 3), dtype=numpy.int64)
    for y in range(height):
        for x in range(width):
            pixels[y, x] = pixel(name, x, y, width, height)
    return pixels


def pixel(name, x, y, width, height):
    if name == "gradient":
        return (x * 255 // (width - 1), y * 255 // (height - 1), (x + y) * 255 // (width + height - 2))
    if name == "texture":
        base = pixel("gradient", x, y, width, height)
        return tuple(clamp(value // 2 + noise(x // 3, y // 2, channel) // 2) for channel, value in enumerate(base))
    if name == "dark":
        grey = 10 + x * 50 // (width - 1)
        return (grey, grey, grey)
    if name == "static":
        return tuple(noise(x, y, channel) for channel in range(3))
    if name == "black":
        return (0, 0, 0)
    if name == "white":
        return (255, 255, 255)
    base, change = name.split("+")
    if change == "noise1" or change == "noise8":
        strength = int(change[5:])
        value = pixel(base, x, y, width, height)
        return tuple(clamp(v + (noise(x, y, 7 + c) * (2 * strength + 1)) // 256 - strength) for c, v in enumerate(value))
    if change == "inverted":
        return tuple(255 - value for value in pixel(base, x, y, width, height))
    if change == "shifted":
        return pixel(base, max(x - 2, 0), max(y - 1, 0), width, height)
    if change == "blurred":
        total = [0, 0, 0]
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                near = pixel(base, min(max(x + dx, 0), width - 1), min(max(y + dy, 0), height - 1), width, height)
                total = [sum + value for sum, value in zip(total, near)]
        return tuple(sum // 9 for sum in total)
    if change == "brighter":
        return tuple(clamp(value + 20) for value in pixel(base, x, y, width, height))
    if change == "dot":
        # One pixel in the middle goes white.
        return (255, 255, 255) if (x, y) == (width // 2, height // 2) else pixel(base, x, y, width, height)
    raise ValueError(name)


PAIRS = [
    ("texture", "texture"),
    ("gradient", "gradient+noise1"),
    ("gradient", "gradient+noise8"),
    ("gradient", "gradient+inverted"),
    ("dark", "dark+noise1"),
    ("texture", "texture+noise1"),
    ("texture", "texture+noise8"),
    ("texture", "texture+inverted"),
    ("texture", "texture+shifted"),
    ("texture", "texture+blurred"),
    ("texture", "texture+brighter"),
    ("texture", "texture+dot"),
    ("static", "texture"),
    ("static", "static+inverted"),
    ("black", "white"),
    ("black", "black+dot"),
    ("white", "white+noise1"),
    ("white", "texture"),
]


def luma(pixels):
    return pixels @ numpy.array([0.2126, 0.7152, 0.0722])


def error(first, second):
    similarity = structural_similarity(
        luma(first), luma(second), gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=255
    )
    return 1.0 - float(similarity)


cases = [
    {"first": first, "second": second, "width": width, "height": height,
     "error": error(build(first, width, height), build(second, width, height))}
    for width, height in SIZES
    for first, second in PAIRS
]
rows = ",\n".join("  " + json.dumps(case) for case in cases)
print(f'{{"scikit-image": "{skimage.__version__}", "cases": [\n{rows}\n]}}')
