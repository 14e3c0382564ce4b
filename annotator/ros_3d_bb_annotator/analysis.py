"""Noise analysis of a session. The figures and the error model are written to a folder. Needs scipy and matplotlib."""
import os
import pathlib

from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse as analyse_noise
from ros_3d_bb_lab.evaluation.noise.report import print_results, write_results
from ros_3d_bb_lab.evaluation.noise.tables import read_session_measurements

__all__ = ['analyse', 'print_results']


def analyse(session, folder, estimator):
    """Analyse the errors of the annotated measurements of a session. Writes report, figures and error model.

    The results are written to `folder`, by default `analysis` in the session. `estimator` is 'foreground', 'median', or
    'recorded' for the stored estimates. Returns the Analysis of the lab, and the folder (pathlib.Path). Raises
    ValueError if there are too few measurements.
    """
    folder = pathlib.Path(folder or os.path.join(session, 'analysis'))
    table = read_session_measurements(session, estimator)
    analysis = analyse_noise(Inputs.of(table, table, table, estimator, 'unknown'))
    write_results(folder, analysis)
    return analysis, folder
