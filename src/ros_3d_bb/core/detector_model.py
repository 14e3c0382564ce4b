"""Detector and camera from image to image: what the tracker has to know beside the covariance of each box."""
from typing import NamedTuple, Optional


class DetectorModel(NamedTuple):
    """Persistence of errors, and probability and range of detections; the defaults apply to unknown cameras.

    Errors up to the standard deviation `lasting_sigma_m` are correlated for `correlation_time_s`; the rest is
    independent in each image. A visible person within `max_range_m` of the camera is detected with
    `detection_probability`; farther people are not expected to be detected. If `max_range_m` is None, the tracker
    learns it (`measurement_model.learned_range`).
    """

    lasting_sigma_m: float = 0.035
    correlation_time_s: float = 0.5
    detection_probability: float = 0.9
    max_range_m: Optional[float] = None


def checked(model: DetectorModel) -> DetectorModel:
    """Return the DetectorModel after validation. Raises ValueError, with the bad value, if it is unusable."""
    for name in ('lasting_sigma_m', 'correlation_time_s'):
        if not 0 <= getattr(model, name) <= 10:
            raise ValueError('detector.%s is %g; 0 to 10 expected' % (name, getattr(model, name)))
    if not 0 < model.detection_probability < 1:
        raise ValueError('detector.detection_probability is %g; more than 0 and less than 1 expected'
                         % model.detection_probability)
    if model.max_range_m is not None and not model.max_range_m > 0:
        raise ValueError('detector.max_range_m is %g; more than 0, or null if unknown, expected' % model.max_range_m)
    return model
