"""Validation of true positions before they are entered."""

HALF_PERSON_M = 0.5  # the body of a person whose axis is just outside the image may be visible


def truth_problems(document, index, truth_m):
    """Problems of a true position (x, y, z) before it is entered: lines of text, or an Outlier."""
    person = document.person_at(index, truth_m[0], truth_m[2])
    outlier = None if person is None else document.estimates.outlier(index, person, truth_m)
    if outlier is None:
        return view_problems(document, truth_m)
    positions = document.estimates.of(index)
    return view_problems(document, truth_m) + [outlier] + [
        'it would be plausible for box %d' % (other + 1) for other, position_m in enumerate(positions)
        if position_m is not None and document.estimates.outlier(index, other, truth_m) is None]


def view_problems(document, truth_m):
    """Problems of a true position (x, y, z) with the field of view of the camera."""
    x_m, _y_m, z_m = truth_m
    if not z_m > 0:
        return ['truth z is %g m; more than 0 expected' % z_m]
    left_m, right_m = document.camera.deproject(
        [(0, document.camera.cy), (document.camera.width, document.camera.cy)], z_m)[:, 0]
    if left_m - HALF_PERSON_M <= x_m <= right_m + HALF_PERSON_M:
        return []
    return ['truth x is %g m, outside the image, which shows %.2f to %.2f m at %g m' % (x_m, left_m, right_m, z_m)]
