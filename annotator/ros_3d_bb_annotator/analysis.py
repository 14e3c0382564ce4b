"""Noise analysis of a session. The figures and the error model are written to a folder. Needs scipy and matplotlib."""
import os
import pathlib
from typing import Any, NamedTuple, Tuple

from ros_3d_bb_annotator.document import ESTIMATOR
from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse as analyse_noise
from ros_3d_bb_lab.evaluation.noise.report import text_of, write_results
from ros_3d_bb_lab.evaluation.noise.tables import read_session_measurements


class Analysed(NamedTuple):
    """Results of an analysis.

    `figures` are pairs (path, caption), `text` contains mean error and spread of both axes. `no_model` is the reason
    why there is no cross-validated error model, or empty. `outliers` were left out.
    """

    folder: str
    report_path: str
    figures: Tuple[Tuple[str, str], ...]
    text: str
    no_model: str
    outliers: Tuple[Any, ...]


def analyse(document, folder=None, estimator=None, progress=lambda share: None):
    """Analyse the errors of the annotated measurements of a document. Writes report, figures and error model.

    The results are written to `folder`, by default `analysis` in the session. `estimator` is 'foreground', 'median', or
    'recorded' for the stored estimates. The default is that of bbox3d_node. `progress` is called with the share 0..1
    that is done. Raises ValueError if there are too few measurements.
    """
    folder = pathlib.Path(folder or os.path.join(document.folder, 'analysis'))
    estimator = estimator or ESTIMATOR
    measurements = read_session_measurements(document.folder, estimator, lambda share: progress(0.2 * share))
    analysis = analyse_noise(Inputs.of_session(measurements, estimator, 'unknown'),
                             lambda share: progress(0.2 + 0.5 * share))
    figures = write_results(folder, analysis, lambda share: progress(0.7 + 0.3 * share))
    return Analysed(str(folder), str(folder / 'report.html'), figures, text_of(analysis), analysis.no_model,
                    analysis.inputs.outliers)
