"""Order of the objects in overlapping rectangles by their depth, and masks of what nearer objects show in them."""
import numpy as np

from ros_3d_bb.estimation.depth_layers import BODY_HALF_DEPTH_MM, UNKNOWN_MM

# Nearer people stand lower in the image. The lower edges of truncated boxes are compared at this height.
CUT_ROWS = 1 / 30.0  # share of the image height
SAME_LAYER_M = 0.25  # largest difference of the layers of parts of one body
CLEARLY_NEARER_M = 0.1
CLEARLY_LOWER = 0.02  # share of the image height
LEAST_SIZE = 0.65  # minimum share of its usual size that an object appears to have at its layer
LEAST_BESIDE = 0.25  # minimum share of a rectangle beside another one that shows a layer of its own
CONTAINED = 0.8  # minimum share of a second rectangle of an object in the first one
MANY = 200  # from this number of rectangles on, those that few others occlude are foremost, too: for speed
MOST_TIES = 256  # pairs of rectangles whose layers beside each other are determined at once: more than in a crowd


class Overlaps(object):
    """Rectangles of an image, those of nearer objects first.

    Parameters
    ----------
    samples : depth_samples.RectSamples
    usable : numpy.ndarray, (n,)
        Whether rectangles have enough depth for an estimate.
    camera : camera_model.Camera
    kinds : sequence of object_classes.ObjectClass
        That of each rectangle.
    truncated : sequence of (bool, bool, bool, bool)
        Which edges of each rectangle touch the image border.
    """

    def __init__(self, samples, usable, camera, kinds, truncated):
        self._samples, rects_px = samples, samples.rects_px
        self._area_px, self._shared_px = _areas(rects_px)
        self._overlap = self._shared_px > 0
        self._lowest_px = np.minimum(rects_px[:, 3], camera.height * (1 - CUT_ROWS))
        self._clearly_lower_px = CLEARLY_LOWER * camera.height
        extent_px = np.maximum(rects_px[:, 2:] - rects_px[:, :2], 1).max(axis=1)
        usual_m = np.array([0 if any(edges) else max(kind.width, kind.height)
                            for edges, kind in zip(truncated, kinds)])
        self._nearest_m = LEAST_SIZE * usual_m * camera.fy / extent_px  # nearer objects would be unusually small
        groups = np.array([kind.group or '' for kind in kinds])
        self._alike = (groups == groups[:, None]) & (groups != '')
        self.pending = usable.copy()  # without an estimate yet
        self._changed = usable.copy()  # since the layer was determined
        self._layer_m = np.zeros(len(rects_px))
        # Layers of rectangles beside each other one, or of the whole rectangles where there is no layer beside it
        self._beside_m = np.zeros(self._shared_px.shape)
        self._is_beside = np.zeros(self._shared_px.shape, bool)
        self._nearer = np.zeros(self._shared_px.shape, bool)  # whether the second of two rectangles is nearer
        self._in_front = np.zeros(len(rects_px), int)  # number of pending rectangles that are nearer
        self.repeats = np.zeros(len(rects_px), bool)  # may be of the object of a larger rectangle

    def take_foremost(self):
        """Take the pending rectangles that no pending rectangle of a nearer object overlaps. Returns their numbers.

        The nearer of two objects is the one with the nearer layer. A layer that both rectangles show belongs to the one
        that shows it beside the other one, too. If that does not decide, of two objects of one kind the nearer one is
        clearly lower in the image, has a clearly nearer layer or is larger, in this order. Of different kinds, it is
        the one that is not too small for the layer, which may be another object's; otherwise the one that appears
        smaller, as a person on a couch.
        """
        pending = np.flatnonzero(self.pending)
        self._update(pending)
        in_front = self._in_front[pending]
        foremost = pending[in_front <= len(pending) // MANY]
        if in_front.all():  # three or more occlude each other in a circle
            foremost = pending[[np.lexsort((-self._area_px[pending], -self._lowest_px[pending]))[0]]]
        self._remove(foremost)
        return foremost

    def _remove(self, numbers):
        self.pending[numbers] = False
        self._in_front -= np.count_nonzero(self._nearer[:, numbers], axis=1)

    def _update(self, pending):
        """Determine the layers of the pending rectangles that have changed and overlap others, and their order."""
        changed = pending[self._changed[pending]]
        changed = changed[self._overlap[changed][:, pending].any(axis=1)]
        if not changed.size:
            return
        others = pending[self._overlap[changed].any(axis=0)[pending]]
        unchanged = others[~self._changed[others]]
        self._layer_m[changed] = self._samples.layers(changed) / 1000
        self._changed[changed] = False
        blocks = [(changed, others), (unchanged, changed)] if unchanged.size else [(changed, others)]
        for numbers, beside in blocks:
            self._determine_layers_beside(numbers, beside)
        for numbers, beside in blocks:
            self._compare(numbers, beside)
        self._in_front = np.count_nonzero(self._nearer & self.pending, axis=1)

    def _determine_layers_beside(self, numbers, others):
        """Determine the layers of rectangles beside each of the others."""
        pairs = np.ix_(numbers, others)
        layers_m = self._layer_m[numbers][:, None]
        self._beside_m[pairs], self._is_beside[pairs] = layers_m, False
        tied = self._overlap[pairs] & (np.abs(layers_m - self._layer_m[others]) < SAME_LAYER_M)
        tied &= self._shared_px[pairs] <= (1 - LEAST_BESIDE) * self._area_px[numbers][:, None]
        if not tied.any():
            return
        rows, columns = np.argwhere(tied)[:MOST_TIES].T
        first, second = numbers[rows], others[columns]
        beside_mm = self._samples.ahead_mm[first]
        for samples_mm, number, other in zip(beside_mm, first.tolist(), second.tolist()):
            self._samples.mask(samples_mm, number, other, UNKNOWN_MM)
        seen = (beside_mm < UNKNOWN_MM).any(axis=1)
        if seen.any():
            self._beside_m[first[seen], second[seen]] = self._samples.layers(first[seen], beside_mm[seen]) / 1000
            self._is_beside[first[seen], second[seen]] = True

    def _compare(self, numbers, others):
        """Determine which of the others are nearer than each of the rectangles, and which rectangles repeat one."""
        pairs, area_px, other_area_px = np.ix_(numbers, others), self._area_px[numbers][:, None], self._area_px[others]
        overlap, alike, shared_px = self._overlap[pairs], self._alike[pairs], self._shared_px[pairs]
        farther_m = self._beside_m[pairs] - self._beside_m[np.ix_(others, numbers)].T
        lower_px = self._lowest_px[others] - self._lowest_px[numbers][:, None]
        larger = np.where(area_px == other_area_px, others < numbers[:, None], other_area_px > area_px)
        is_small, other_is_small = (self._layer_m[those] < self._nearest_m[those] for those in (numbers, others))
        unlike_nearer = np.where(other_is_small == is_small[:, None], ~larger, is_small[:, None])
        tied = np.abs(farther_m) < SAME_LAYER_M
        nearer = np.where(np.abs(farther_m) < CLEARLY_NEARER_M, larger, farther_m > 0)
        nearer = np.where(np.abs(lower_px) > self._clearly_lower_px, lower_px > 0, nearer)
        nearer = overlap & np.where(tied, np.where(alike, nearer, unlike_nearer), farther_m > 0)
        self._nearer[pairs] = nearer
        self.repeats[numbers] |= (tied & alike & nearer & (shared_px >= CONTAINED * area_px)).any(axis=1)

    def mask_behind(self, number, farthest_mm):
        """Mask what is not farther than `farthest_mm` in the pending rectangles that overlap an estimated one."""
        for other in np.flatnonzero(self.pending & self._overlap[number]).tolist():
            layer_m = self._beside_m[other, number]
            is_farther = layer_m - self._beside_m[number, other] >= SAME_LAYER_M and (
                self._is_beside[other, number] or not self._alike[other, number])
            own_mm = 1000 * layer_m - BODY_HALF_DEPTH_MM if is_farther else UNKNOWN_MM  # from there on, its own body
            if self._samples.mask(self._samples.ahead_mm[other], other, number, min(farthest_mm, own_mm)):
                self._changed[other] = True
                if (self._samples.ahead_mm[other] == UNKNOWN_MM).all():
                    self._remove([other])


def _areas(rects_px):
    """Areas (n,) of rectangles (n, 4), and those that they share with each other one (n, n; diagonal: 0), pixels."""
    x1, y1, x2, y2 = rects_px.T
    shared_px = (np.maximum(np.minimum(x2, x2[:, None]) - np.maximum(x1, x1[:, None]), 0)
                 * np.maximum(np.minimum(y2, y2[:, None]) - np.maximum(y1, y1[:, None]), 0))
    area_px = shared_px.diagonal().copy()
    np.fill_diagonal(shared_px, 0)
    return area_px, shared_px
