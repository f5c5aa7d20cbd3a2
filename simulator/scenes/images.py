"""Image files as RGBA of 8 bits a channel, converted by value: 16-bit and floating-point grey is not clipped."""

import io

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError

WIDE = {
    "I": 65535.0,
    "F": 1.0,
}  # the white of Pillow's grey modes of more than 8 bits ("I;16" and its like are 16 bits)


def read_image(data: bytes, what: str) -> NDArray[np.uint8]:
    """Decode an image file to RGBA, (H, W, 4) uint8; raises a sentence where it cannot be read."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data)) as image:
            mode = image.mode.partition(";")[0]
            if mode in WIDE:
                return _grey(
                    np.asarray(image, dtype=np.float64) / WIDE[mode], image.info.get("transparency"), WIDE[mode]
                )
            clear = image.info.get("transparency")
            if image.mode == "RGB" and isinstance(clear, tuple) and max(clear) > 255:  # of 16 bits, as Pillow gives it
                image.info["transparency"] = tuple(value >> 8 for value in clear)
            return np.asarray(image.convert("RGBA"), dtype=np.uint8)
    except Exception as error:  # noqa: BLE001 (whatever a decoder of broken bytes raises, the file is to blame)
        reason = f" ({error})" if isinstance(error, Image.DecompressionBombError) else ""
        raise TilestampError(f"{what} is not an image that can be read{reason}") from None


def _grey(values: NDArray[np.float64], clear: object, white: float) -> NDArray[np.uint8]:
    """RGBA of grey values in [0, 1], transparent where they are the one value that the file names."""
    grey = np.rint(np.clip(np.nan_to_num(values), 0.0, 1.0) * 255.0).astype(np.uint8)
    alpha = np.where(np.rint(values * white) == clear, 0, 255) if isinstance(clear, int) else np.full(grey.shape, 255)
    return np.stack([grey, grey, grey, alpha.astype(np.uint8)], axis=2)
