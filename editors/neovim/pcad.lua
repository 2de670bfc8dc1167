-- For Neovim 0.11 or later: put this file into ~/.config/nvim/plugin/.

vim.filetype.add({ extension = { pcad = "pcad" } })

vim.lsp.config("pcadlang", {
  cmd = { "pcadlang", "lsp" },
  filetypes = { "pcad" },
})
vim.lsp.enable("pcadlang")

vim.api.nvim_create_autocmd("FileType", {
  pattern = "pcad",
  callback = function()
    vim.bo.commentstring = "// %s"
  end,
})
