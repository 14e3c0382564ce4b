"""Track score: log odds that a track is an object and not a series of false detections.

The score is the sum of the log-likelihood ratios of the detections and misses of a track (Sittler 1964; Blackman and
Popoli, Design and Analysis of Modern Tracking Systems, 1999, 6.2). Those of successive images are not independent:
detectors repeat their errors. An image therefore counts the more, the longer the time since the previous one: at high
image rates, the score depends on the time and not on the number of images.

Convention: `tracks` are arrays of `track.TRACK` and modified in place.
"""
import math

import numpy as np

# Without scores, four images at 30 Hz, three at 10 Hz, or two at least 0.2 s apart confirm a track by default.
HIT_WEIGHT, HIT_CORRELATION_S = 1.15, 0.074
MISS_CORRELATION_S = 0.15  # the causes of misses, such as poses and partial occlusion, last longer
UNKNOWN_SCORE = 0.5
# Of the score of a detection. A high score does not mean that the position is right, as of a person half hidden.
MIN_LOG_ODDS, MAX_LOG_ODDS = -2.0, 1.0
HIT = 0.4  # of a detection where a track is expected: little, because false detections repeat at their place, too
MAX_TRACK_SCORE = 4.0  # earlier evidence is forgotten: an undetected person is published for 0.4 s
MIN_TRACK_SCORE = -2.0  # with less (12 % probability), tracks do not start, and undetected tracks are not published


def log_odds_of(scores, even_score):
    """Log odds (n,) that detections with scores (n,) show an object. Scores are 0..1, and 0 if unknown; half of the
    detections with the score `even_score` do."""
    known = np.minimum(np.where(scores > 0, scores, UNKNOWN_SCORE), 0.9999)
    log_odds = np.log(known / (1 - known)) - _logit(even_score)
    return np.minimum(np.maximum(log_odds, MIN_LOG_ODDS), MAX_LOG_ODDS)


def _logit(probability):
    return math.log(probability / (1 - probability))


def add_detections(tracks, scores, elapsed_s, params):
    """Add detections with scores (n,) to tracks (n,), `elapsed_s` (n,) after the previous images, and confirm tracks;
    `params` are `tracker.TrackerParams`.

    The score is at least that of a new track: a new target may be where false detections were (as in Page's test,
    1954).
    """
    log_odds = log_odds_of(scores, params.even_score)
    sums = tracks['log_odds'] + HIT_WEIGHT * (1 - np.exp(-elapsed_s / HIT_CORRELATION_S)) * (log_odds + HIT)
    tracks['log_odds'] = np.minimum(np.maximum(sums, log_odds), MAX_TRACK_SCORE)
    tracks['confirmed'] |= tracks['log_odds'] >= _logit(params.confirmation_probability)


def add_misses(tracks, elapsed_s, detection_probability):
    """Subtract misses of tracks that a camera should have detected, and has not for `elapsed_s` (n,)."""
    tracks['log_odds'] += np.minimum(elapsed_s / MISS_CORRELATION_S, 1) * math.log(1 - detection_probability)
