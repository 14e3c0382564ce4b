"""Tables in the format of the thesis with known statistics."""
import csv

import numpy as np

COLUMNS = ['X measured', 'X true', 'Z measured', 'Z true', 'X error', 'X absolute error', 'Z error', 'Z absolute error']
Z_POLY, X_POLY = (-0.04, 0.06, 0.008), (-0.106, -0.006)
RANGES_M, SIDES_M = (0.6, 0.9, 1.2, 1.5, 2.0, 2.5, 3.0), (-1.23, -0.65, 0.0, 0.65, 1.23)
Z_SIGMA_M, X_SIGMA_M = 0.0474, 0.018


def rows_of(repetitions=6):
    """Rows in millimetres. The clusters have exactly the mean errors of the polynomials and the standard deviations."""
    random, rows = np.random.RandomState(1), []
    for z_m in RANGES_M:
        for x_m in SIDES_M:
            z_error_m, x_error_m = (
                np.polyval(poly, true_m) + sigma_m * _standardised(random.normal(size=repetitions))
                for poly, true_m, sigma_m in ((Z_POLY, z_m, Z_SIGMA_M), (X_POLY, x_m, X_SIGMA_M)))
            rows += [[1000 * value for value in (x_m + x, x_m, z_m + z, z_m, x, abs(x), z, abs(z))]
                     for x, z in zip(x_error_m, z_error_m)]
    return rows


def write_table(path, rows, columns=COLUMNS):
    with open(str(path), 'w', newline='') as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(rows)
    return str(path)


def _standardised(values):
    return (values - values.mean()) / values.std()
