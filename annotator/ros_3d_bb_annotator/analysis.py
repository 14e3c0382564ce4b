"""Noise analysis of a session. The figures and the error model are written to a folder. Needs scipy and matplotlib."""
import os
import pathlib
from typing import NamedTuple, Tuple

import numpy as np

from ros_3d_bb_annotator.document import ESTIMATOR
from ros_3d_bb_annotator.measurement import ANNOTATED
from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse as analyse_noise
from ros_3d_bb_lab.evaluation.noise.report import text_of, write_results
from ros_3d_bb_lab.evaluation.noise.tables import MeasurementTable, read_session_measurements

RECORDED = 'recorded'


class Analysed(NamedTuple):
    """Results of an analysis. `text` contains mean error and spread of both axes. `no_model` is the reason why there is
    no cross-validated error model, or empty.
    """

    folder: str
    report_path: str
    figure_paths: Tuple[str, ...]
    text: str
    no_model: str


def analyse(document, folder=None, estimator=None):
    """Analyse the errors of the annotated measurements of a document. Writes report, figures and error model.

    The results are written to `folder`, by default `analysis` in the session. `estimator` is 'foreground', 'median', or
    'recorded' for the stored estimates. The default is that of bbox3d_node, or 'recorded' for the old
    format, which has no depth. Raises ValueError if there are too few measurements, or an image cannot be read.
    """
    folder = pathlib.Path(folder or os.path.join(document.folder, 'analysis'))
    estimator = estimator or (RECORDED if document.is_old_format else ESTIMATOR)
    measurements = (_recorded(document, estimator) if document.is_old_format
                    else read_session_measurements(document.folder, estimator))
    analysis = analyse_noise(Inputs(measurements, measurements, measurements.whole(), estimator, 'unknown'))
    write_results(folder, analysis)
    return Analysed(str(folder), str(folder / 'report.html'), tuple(sorted(map(str, folder.glob('figure_*.png')))),
                    text_of(analysis), analysis.no_model)


def _recorded(document, estimator):
    """Stored estimates of a document of the old format, which does not store which people are truncated."""
    if estimator != RECORDED:
        raise ValueError('%s: only the recorded estimates can be analysed, not those of %r, because depth is not stored'
                         % (document.folder, estimator))
    used = [measurement for measurement in document.measurements
            if measurement.state == ANNOTATED and measurement.estimate_m is not None]
    if not used:
        raise ValueError('%s: no annotated measurement with an estimate' % document.folder)
    return MeasurementTable(document.folder, np.array([measurement.estimate_m for measurement in used]),
                            np.array([(measurement.truth_m[0], measurement.truth_m[2]) for measurement in used]),
                            np.zeros(len(used), bool))
