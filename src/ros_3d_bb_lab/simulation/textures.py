"""Procedural textures of floors, ceilings and walls, RGB uint8. `random` is a numpy.random.RandomState."""
import cv2
import numpy as np

FLOOR_PPM, CEILING_PPM, WALL_PPM = 48, 24, 64  # pixels per metre
FLOOR_TILE_M, CEILING_TILE_M = .6, .6
WHITE, FRAME = (240, 240, 240), (70, 70, 70)


def mottle(size_px, random, octaves=6):
    """Random shading (size_px, size_px) of several scales, with mean 0 and standard deviation 1."""
    total = np.zeros((size_px, size_px), np.float32)
    for octave in range(octaves):
        cells = max(2, size_px >> (octaves - octave))
        noise = random.standard_normal((cells, cells)).astype(np.float32)
        total += cv2.resize(noise, (size_px, size_px), interpolation=cv2.INTER_CUBIC) / (octave + 1) ** .7
    return (total - total.mean()) / total.std()


def floor(width_m, depth_m, random):
    image = _mottled((155, 153, 146), width_m, depth_m, FLOOR_PPM, 6, random)
    tile = int(FLOOR_TILE_M * FLOOR_PPM)
    image[::tile] *= .85
    image[:, ::tile] *= .85
    return _to_uint8(image)


def ceiling(width_m, depth_m):
    image = np.full((int(depth_m * CEILING_PPM), int(width_m * CEILING_PPM), 3), (205, 203, 200), np.uint8)
    tile = int(CEILING_TILE_M * CEILING_PPM)
    image[::tile], image[:, ::tile] = 170, 170
    for y in range(2 * tile, image.shape[0], 4 * tile):
        for x in range(2 * tile, image.shape[1], 4 * tile):
            cv2.rectangle(image, (x, y), (x + 2 * tile, y + tile // 2), (255, 255, 255), cv2.FILLED)
    return image


def wall(length_m, height_m, color, random):
    """Painted wall with a skirting board, doors, windows and posters. The lower edge is at the floor."""
    image = _mottled(color, length_m, height_m, WALL_PPM, 3, random)
    image[-int(.1 * WALL_PPM):] *= .55
    draws = (_draw_door, _draw_window, _draw_poster, lambda _image, _left_m, _random: 1.0)
    left_m = .8
    while left_m < length_m - 2:
        left_m += draws[random.randint(len(draws))](image, left_m, random)
    return _to_uint8(cv2.GaussianBlur(image, (0, 0), .7))


def _draw_door(image, left_m, random):
    color = tuple(random.uniform(60, 150, 3))
    _rectangle(image, left_m, 0, .95, 2.05, color, cv2.FILLED)
    _rectangle(image, left_m, 0, .95, 2.05, FRAME, 3)
    cv2.circle(image, _pixel(image, left_m + .85, 1.0), 3, (200, 200, 200), cv2.FILLED)
    return 2.0


def _draw_window(image, left_m, _random):
    _rectangle(image, left_m, .9, 1.6, 1.2, (150, 190, 215), cv2.FILLED)
    _rectangle(image, left_m, .9, 1.6, 1.2, WHITE, 5)
    cv2.line(image, _pixel(image, left_m + .8, .9), _pixel(image, left_m + .8, 2.1), WHITE, 4)
    return 2.4


def _draw_poster(image, left_m, random):
    width, height = (random.uniform(.4, low) for low in (.9, .8))
    picture = cv2.resize(random.uniform(40, 220, (3, 3, 3)), (int(width * WALL_PPM), int(height * WALL_PPM)),
                         interpolation=cv2.INTER_CUBIC)
    x, y = _pixel(image, left_m, min(1.9, image.shape[0] / WALL_PPM))
    window = image[y:y + picture.shape[0], x:x + picture.shape[1]]
    window[:] = picture[:window.shape[0], :window.shape[1]]
    return 1.6


def _rectangle(image, left_m, bottom_m, width_m, height_m, color, thickness):
    cv2.rectangle(image, _pixel(image, left_m, bottom_m), _pixel(image, left_m + width_m, bottom_m + height_m), color,
                  thickness)


def _pixel(image, x_m, z_m):
    return int(x_m * WALL_PPM), image.shape[0] - int(z_m * WALL_PPM)


def _mottled(color, width_m, height_m, ppm, strength, random):
    size = (int(width_m * ppm), int(height_m * ppm))
    image = np.empty((size[1], size[0], 3), np.float32)
    image[:] = color
    return image + strength * cv2.resize(mottle(512, random), size)[..., None]


def _to_uint8(image):
    return np.clip(image, 0, 255).astype(np.uint8)
