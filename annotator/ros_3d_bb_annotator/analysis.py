"""Noise analysis of a session. The figures and the error model are written to a folder. Needs scipy and matplotlib."""
import os
import pathlib
from typing import Any, NamedTuple, Tuple

import numpy as np

from ros_3d_bb.estimation.error_model import RECORDED
from ros_3d_bb_annotator.export import default_estimator
from ros_3d_bb_annotator.measurement import ANNOTATED
from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse as analyse_noise
from ros_3d_bb_lab.evaluation.noise.report import text_of, write_results
from ros_3d_bb_lab.evaluation.noise.tables import MeasurementTable, read_session_measurements


class Analysed(NamedTuple):
    """Results of an analysis.

    `text` contains mean error and spread of both axes. `model_note` is why there is no error model, or empty.
    `outliers` were left out.
    """

    folder: str
    report_path: str
    text: str
    model_note: str
    outliers: Tuple[Any, ...]


def analyse(document, folder=None, estimator=None):
    """Analyse the errors of the annotated measurements of a document. Writes report, figures and error model.

    The results are written to `folder`, by default `analysis` in the session. `estimator` is 'foreground', 'median', or
    'recorded' for the stored estimates. The default is that of bbox3d_node, or 'recorded' for the old format, which has
    no depth. Raises ValueError if there are too few measurements.
    """
    folder = pathlib.Path(folder or os.path.join(document.folder, 'analysis'))
    estimator = estimator or default_estimator(document)
    measurements = (_recorded(document, estimator) if document.is_old_format
                    else read_session_measurements(document.folder, estimator))
    analysis = analyse_noise(Inputs.of_session(measurements, estimator, 'unknown'))
    write_results(folder, analysis)
    return Analysed(str(folder), str(folder / 'report.html'), text_of(analysis), analysis.model_note,
                    analysis.inputs.outliers)


def _recorded(document, estimator):
    """Stored estimates of a document of the old format, which does not store which people are truncated."""
    if estimator != RECORDED:
        raise ValueError('%s: only the recorded estimates can be analysed, not those of %r, because depth is not stored'
                         % (document.folder, estimator))
    people = [(measurement.name, measurement.detections[person].estimate_m, truth_m)
              for measurement in document.measurements if measurement.state == ANNOTATED
              for person, truth_m in measurement.truths.items()]
    people = [person for person in people if person[1] is not None]
    if not people:
        raise ValueError('%s: no annotated measurement with an estimate' % document.folder)
    names, measured_m, truth_m = zip(*people)
    return MeasurementTable(document.folder, np.array(measured_m), np.array(truth_m)[:, [0, 2]].astype(float),
                            np.zeros(len(people), bool), names)
