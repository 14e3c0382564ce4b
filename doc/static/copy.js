// A button that copies the text of a block of code.
document.addEventListener('DOMContentLoaded', () => {
  for (const block of document.querySelectorAll('div.highlight')) {
    const button = document.createElement('button');
    button.className = 'copy';
    button.textContent = 'Copy';
    button.onclick = () => navigator.clipboard.writeText(block.querySelector('pre').textContent)
      .then(() => { button.textContent = 'Copied'; }, () => { button.textContent = 'Not permitted'; });
    block.appendChild(button);
  }
});
