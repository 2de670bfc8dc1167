"""pcadlang in Jupyter notebooks: cells of programs, results that show themselves, live pictures.

    %load_ext pcadlang.notebook

    %%pcad line
    assume slope ~ normal(0, 5);
    observe normal(slope, 1) = 2;

    pcadlang.notebook.sample(line.compile(), steps=1000)

IPython is imported when the extension is loaded or something is shown, and anywidget when a solid
is: neither is needed to import this module.
"""

from pcadlang.notebook.extension import load_ipython_extension, unload_ipython_extension
from pcadlang.notebook.photo import show
from pcadlang.notebook.progress import sample

__all__ = ["load_ipython_extension", "sample", "show", "unload_ipython_extension"]
