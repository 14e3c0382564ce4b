"""Report as one HTML file that contains its figures: the page, and its elements as HTML text."""
import base64
import html
import mimetypes

# Figures and tables are numbered by the style.
PAGE = '''<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>{title}</title><style>
body {{ font: 16px/1.5 sans-serif; max-width: 54em; margin: 2em auto; padding: 0 1em; color: #222;
       counter-reset: figure table; }}
table {{ display: block; overflow-x: auto; border-collapse: collapse; margin: 0.3em 0 1.2em; font-size: 0.9em; }}
td, th {{ padding: 0.15em 0.8em; text-align: right; vertical-align: top; }}
th {{ border-bottom: 1px solid #888; }} td:first-child, th:first-child {{ text-align: left; padding-left: 0; }}
.pairs td, .pairs th {{ text-align: left; }}
img {{ max-width: 100%; }} figure {{ margin: 1.5em 0; }}
@media (max-width: 600px) {{ td, th {{ padding: 0.15em 0.25em; font-size: 0.85em; }} }}
figcaption, .caption {{ color: #444; font-size: 0.9em; margin: 0.5em 0 0; }}
figcaption::before {{ counter-increment: figure; content: "Figure " counter(figure) ": "; }}
.caption::before {{ counter-increment: table; content: "Table " counter(table) ": "; }}
</style></head><body>
<h1>{title}</h1>
{body}
</body></html>
'''


def html_report(title, elements):
    return PAGE.format(title=html.escape(title), body='\n'.join(elements))


def heading(text):
    return '<h2>%s</h2>' % html.escape(text)


def paragraph(text):
    return '<p>%s</p>' % html.escape(text)


def figure(path, caption):
    data, caption = base64.b64encode(path.read_bytes()).decode(), html.escape(caption)
    return '<figure><img src="data:%s;base64,%s" alt="%s"><figcaption>%s</figcaption></figure>' % (
        mimetypes.guess_type(path.name)[0], data, caption, caption)


def table(caption, header, rows):
    lines = [_row('th', header)] + [_row('td', row) for row in rows]
    kind = ' class="pairs"' if len(header) == 2 else ''  # names and values, which may be text
    return '<p class="caption">%s</p>\n<table%s>\n%s\n</table>' % (html.escape(caption), kind, '\n'.join(lines))


def _row(cell, texts):
    return '<tr>%s</tr>' % ''.join('<%s>%s</%s>' % (cell, html.escape(text), cell) for text in texts)
