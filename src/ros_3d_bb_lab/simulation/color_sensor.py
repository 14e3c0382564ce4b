"""Model of the colour sensor: slight blur and noise."""
import cv2
import numpy as np

SPARE_PX = 64  # the noise field is this much larger than the image; each frame uses a random part of it
FIELDS = 4
BLUR_PX, GRAIN_PX = .65, .6


class ColorSensor(object):
    """Colour sensor, whose noise depends on the seed and the number of the frame only.

    Parameters
    ----------
    camera : geometry.Camera
    seed : int
    sigma : float
        Standard deviation of the noise, in grey levels.
    """

    def __init__(self, camera, seed, sigma):
        random = np.random.RandomState(seed)
        self._seed, self._shape = seed, (camera.height, camera.width)
        self._fields = [_field(random, self._shape, sigma) for _ in range(FIELDS)]

    def capture(self, color, number):
        """Apply blur and noise to a rendered image (h, w, 3), uint8. Returns a new image."""
        random = np.random.RandomState([self._seed, number])
        field = self._fields[random.randint(FIELDS)]
        y, x = random.randint(SPARE_PX, size=2)
        part = field[y:y + self._shape[0], x:x + self._shape[1]]
        return cv2.add(cv2.GaussianBlur(color, (3, 3), BLUR_PX), part, dtype=cv2.CV_8U)


def _field(random, shape, sigma):
    noise = random.standard_normal((shape[0] + SPARE_PX, shape[1] + SPARE_PX, 3)).astype(np.float32)
    noise = cv2.GaussianBlur(noise, (0, 0), GRAIN_PX)
    return np.rint(noise * (sigma / noise.std())).clip(-127, 127).astype(np.int8)
