"""Noise analysis of a session. The figures and the error model are written to a folder. Needs scipy and matplotlib."""
import os
import pathlib

from ros_3d_bb_annotator.estimates import ESTIMATOR
from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse as analyse_noise
from ros_3d_bb_lab.evaluation.noise.report import text_of, write_results
from ros_3d_bb_lab.evaluation.noise.tables import read_session_measurements


def analyse(document, folder=None, estimator=ESTIMATOR):
    """Analyse the errors of the annotated measurements of a document. Writes report, figures and error model.

    The results are written to `folder`, by default `analysis` in the session. `estimator` is 'foreground', 'median', or
    'recorded' for the stored estimates. Returns the Analysis of the lab, a summary as text, and the folder
    (pathlib.Path). Raises ValueError if there are too few measurements.
    """
    folder = pathlib.Path(folder or os.path.join(document.folder, 'analysis'))
    measurements = read_session_measurements(document.folder, estimator)
    analysis = analyse_noise(Inputs.of_session(measurements, estimator, 'unknown'))
    write_results(folder, analysis)
    return analysis, text_of(analysis), folder
