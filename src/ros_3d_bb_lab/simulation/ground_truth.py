"""Ground truth as tracks, to be published and compared with the tracker's output."""
import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE, TrackedObject, prediction_times_s

MIN_VISIBLE = 0.25  # minimum share of the body in the image of a person with the status VISIBLE
MOVING_MPS = 0.05
PREDICTION_S, PREDICTION_STEP_S = 2.0, 0.25


def truth_at(simulator, frame, stamp_ns):
    """Convert the people of a frame to tracks in the map frame. Their predictions are their actual future positions.

    Parameters
    ----------
    simulator : Simulator
    frame : Frame
    stamp_ns : int
        Stamp of the frame. The tracks are first seen at the start of the scene.

    Returns
    -------
    list of TrackedObject
    """
    times_s = prediction_times_s(PREDICTION_S, PREDICTION_STEP_S)
    paths = np.stack([simulator.positions_at(frame.time_s + time_s) for time_s in times_s], axis=1)
    start_ns = stamp_ns - int(round(frame.time_s * NS))
    return [TrackedObject(person.id, person.position_m, person.size_m, person.velocity_mps, person.velocity_mps,
                          _status(person), bool(np.linalg.norm(person.velocity_mps) > MOVING_MPS), start_ns, stamp_ns,
                          np.c_[path, np.full(len(path), person.position_m[2])], PREDICTION_STEP_S)
            for person, path in zip(frame.people, paths)]


def _status(person):
    if person.visible >= MIN_VISIBLE:
        return VISIBLE
    return OCCLUDED if person.hidden > 1 - person.inside else OUT_OF_VIEW  # the larger share decides
