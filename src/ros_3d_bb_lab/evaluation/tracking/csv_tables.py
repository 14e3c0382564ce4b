"""Tables of recordings: CSV files with named columns."""
import csv


def read_rows(path, columns, texts=()):
    """Rows of a CSV file as dictionaries with these columns, numbers except for `texts`. Other columns are ignored.

    Raises ValueError if a column is missing or a value is not a number; the message names the file and the line.
    """
    with open(path, newline='', encoding='utf-8-sig') as stream:
        reader = csv.DictReader(stream)
        try:
            if not set(columns) <= set(reader.fieldnames or ()):
                raise ValueError('%s has the columns %s; %s expected'
                                 % (path, ','.join(reader.fieldnames or ()), ','.join(columns)))
            return [_row(path, reader.line_num, line, columns, texts) for line in reader]
        except csv.Error as error:
            raise ValueError('%s cannot be read as a table (%s)' % (path, error))


def _row(path, number, line, columns, texts):
    try:
        return {key: line[key] if key in texts else float(line[key]) for key in columns}
    except (TypeError, ValueError):
        raise ValueError('%s, line %d: %s; a number in each column expected'
                         % (path, number, ','.join(str(line[key]) for key in columns)))
