-- The language server and the settings of `.mech` files.
vim.bo.commentstring = "// %s"
vim.bo.expandtab, vim.bo.shiftwidth, vim.bo.tabstop = true, 4, 4
vim.bo.makeprg = "flexura check %"

local buffer = vim.api.nvim_get_current_buf()
local folder = vim.fn.fnamemodify(vim.api.nvim_buf_get_name(buffer), ":p:h")
local settings = { name = "flexura", cmd = { "flexura", "lsp" }, root_dir = folder }
if vim.fn.executable("flexura") == 0 then
  vim.notify_once("flexura is not on the path: no language server for .mech files", vim.log.levels.WARN)
elseif vim.lsp.start then
  vim.lsp.start(settings, { bufnr = buffer })
else
  -- Before 0.8: one server for all buffers.
  vim.g.flexura_client = vim.g.flexura_client or vim.lsp.start_client(settings)
  vim.lsp.buf_attach_client(buffer, vim.g.flexura_client)
end
if vim.lsp.inlay_hint and vim.lsp.inlay_hint.enable then
  pcall(vim.lsp.inlay_hint.enable, true, { bufnr = buffer })
end

-- Colours and folds of the tree-sitter grammar, where it is installed (editors/tree-sitter-flexura/install.sh neovim).
if vim.treesitter.language and vim.treesitter.language.register then
  pcall(vim.treesitter.language.register, "flexura", "mech")
end
if vim.treesitter.start and pcall(vim.treesitter.start, buffer, "flexura") then
  vim.wo.foldmethod = "expr"
  vim.wo.foldexpr = vim.treesitter.foldexpr and "v:lua.vim.treesitter.foldexpr()" or ""
  vim.wo.foldlevel = 99
end

-- :FlexuraBuild, :FlexuraSimulate, ... : the commands of the server, on this file.
local commands = {
  Build = "build",
  Simulate = "simulate",
  ShowReport = "showReport",
  ApplyOptimised = "applyOptimised",
  BetterRest = "betterRest",
}
for name, command in pairs(commands) do
  vim.api.nvim_buf_create_user_command(buffer, "Flexura" .. name, function()
    if command == "build" or command == "showReport" then vim.cmd("silent update") end
    vim.lsp.buf_request(buffer, "workspace/executeCommand", {
      command = "flexura." .. command,
      arguments = { vim.uri_from_bufnr(buffer) },
    }, function(why, answer)
      if why then vim.notify("flexura: " .. why.message, vim.log.levels.ERROR) end
    end)
  end, { desc = "Flexura: " .. name })
end
