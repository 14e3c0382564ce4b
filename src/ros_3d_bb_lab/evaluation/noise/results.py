"""Output of the noise analysis: a folder with report, figures, summary and error models, and a short text."""
import json

from ros_3d_bb.estimation.error_model import write_error_model
from ros_3d_bb_lab.evaluation.noise.analysis import summary_of
from ros_3d_bb_lab.evaluation.noise.figures import polynomial_text, write_figures
from ros_3d_bb_lab.evaluation.noise.report import report_of
from ros_3d_bb_lab.evaluation.noise.tables import clusters_of


def write_results(folder, analysis):
    """Write the report with its figures, summary.json and the error models into a folder (pathlib.Path).

    The folder is created if it does not exist. Raises OSError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_figures(folder, analysis, clusters_of(analysis.inputs.z, 'Z'), clusters_of(analysis.inputs.x_variance, 'X'))
    (folder / 'report.html').write_text(report_of(analysis), encoding='utf-8')
    (folder / 'summary.json').write_text(json.dumps(summary_of(analysis), indent=1), encoding='utf-8')
    for name, model in (('error_model_thesis_form.yaml', analysis.thesis_form),
                        ('error_model.yaml', analysis.model or analysis.thesis_form)):
        if model is not None:
            write_error_model(folder / name, model)


def text_of(analysis):
    """Mean error and standard deviation of both axes as text, one line per axis."""
    return '\n'.join(
        'f(%s) = %s, largest variance %.5f m², standard deviation %.4f m'
        % (name, polynomial_text(axis.poly, name), variances.max_variance_m2, variances.max_sigma_m)
        for name, axis, variances in (('z', analysis.z, analysis.z), ('x', analysis.x, analysis.x_variance)))
