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
