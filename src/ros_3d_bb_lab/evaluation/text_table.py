"""Results of benchmarks as text."""


def text_of(value):
    """A value with four digits; `-` for None."""
    return '-' if value is None else '%.4g' % value if isinstance(value, float) else str(value)


def line_of(*values, **named):
    return '  '.join([text_of(value) for value in values] + ['%s %s' % (name, text_of(named[name])) for name in named])


def table_of(rows):
    """Lines of a table, given its rows as {name: {column: value}}; values that are collections are left out."""
    columns = [key for key, value in next(iter(rows.values())).items() if not isinstance(value, (dict, list))]
    texts = [[str(name)] + [text_of(row.get(key)) for key in columns] for name, row in rows.items()]
    return lines_of([''] + list(map(str, columns)), texts)


def lines_of(header, rows):
    widths = [max(map(len, column)) for column in zip(header, *rows)]
    return ['  '.join(text.rjust(width) for text, width in zip(row, widths)) for row in [header] + rows]


def transposed(rows):
    return {key: {name: row[key] for name, row in rows.items()} for key in next(iter(rows.values()))}
