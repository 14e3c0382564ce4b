// A button that copies the text of a block of code; in tables, line breaks after / and _ and, for phones, titles of columns.
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
    for (const cell of table.querySelectorAll('td')) cell.dataset.title = cell.textContent && titles[cell.cellIndex];
    for (const code of table.querySelectorAll('code span.pre')) code.innerHTML = code.innerHTML.replace(/[/_]/g, '$&<wbr>');
  }
});
