// A button that copies the text of a block of code. In tables: lines break after / and _, and not before units; titles of
// columns, for phones.
document.addEventListener('DOMContentLoaded', () => {
  for (const block of document.querySelectorAll('div.highlight')) {
    const button = document.createElement('button');
    button.className = 'copy';
    button.textContent = 'Copy';
    button.onclick = () => navigator.clipboard.writeText(block.querySelector('pre').textContent)
      .then(() => { button.textContent = 'Copied'; }, () => { button.textContent = 'Not permitted'; });
    block.appendChild(button);
  }
  for (const table of document.querySelectorAll('table.docutils')) {
    const titles = [...table.querySelectorAll('th')].map(title => title.textContent);
    for (const cell of table.querySelectorAll('td')) {
      cell.dataset.title = cell.textContent && titles[cell.cellIndex];
      cell.innerHTML = cell.innerHTML.replace(/(\d) (%|(?:mm?|m?s|m\/s|MB|Hz)\b)/g, '$1&nbsp;$2');
    }
    for (const code of table.querySelectorAll('code span.pre')) code.innerHTML = code.innerHTML.replace(/(?<=\w)[/_]/g, '$&<wbr>');
  }
});
