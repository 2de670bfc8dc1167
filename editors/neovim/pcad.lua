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
    -- Colours from the tree, if ~/.config/nvim has parser/pcad.so and queries/pcad/.
    pcall(vim.treesitter.start)
  end,
})
