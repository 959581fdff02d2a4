-- Asks the language server everything through a real editor: `nvim --headless -u NONE -l` is newer than some, so
--   FLEXURA=target/release/flexura FOLDER=… nvim --headless -u NONE -c 'luafile tests/external/editor.lua'
-- FOLDER holds finger.mech, hand.mech (a design with imports) and broken.mech (one with errors). Writes a transcript to
-- the standard output; ends with exit code 1 at the first answer that is not as it should be.

local function say(text) io.stdout:write(text .. "\n") end
local function fail(text) say("FAILED: " .. text); vim.cmd("cquit 1") end
local function check(name, good, shown)
  say(string.format("%-28s %s", name, shown or (good and "yes" or "no")))
  if not good then fail(name) end
end

local folder, server = vim.env.FOLDER, vim.env.FLEXURA
local client
local function open(name)
  vim.cmd("edit " .. folder .. "/" .. name)
  client = client or vim.lsp.start_client({ name = "flexura", cmd = { server, "lsp" }, root_dir = folder })
  vim.lsp.buf_attach_client(0, client)
  vim.wait(20000, function() return vim.lsp.buf_is_attached(0, client) and vim.lsp.get_client_by_id(client) ~= nil
    and vim.lsp.get_client_by_id(client).initialized end, 20)
end

-- Puts the cursor behind a text.
local function seek(text)
  local lines = vim.api.nvim_buf_get_lines(0, 0, -1, false)
  for i, line in ipairs(lines) do
    local _, last = line:find(text, 1, true)
    if last then vim.api.nvim_win_set_cursor(0, { i, last - 1 }); return end
  end
  fail("there is no " .. text)
end

local function ask(method, more)
  local params = vim.lsp.util.make_position_params()
  for k, v in pairs(more or {}) do params[k] = v end
  local answers, why = vim.lsp.buf_request_sync(0, "textDocument/" .. method, params, 20000)
  if not answers then fail(method .. ": " .. tostring(why)) end
  for _, answer in pairs(answers) do
    if answer.error then return nil, answer.error.message end
    return answer.result
  end
end

local function codes()
  local all = {}
  for _, d in ipairs(vim.diagnostic.get(0)) do table.insert(all, d.code) end
  table.sort(all)
  return table.concat(all, " ")
end

say("a design with imports")
open("finger.mech")
seek("(0 mm, 40 mm * s")
local hover = ask("hover")
check("hover", hover and hover.contents.value:find("param s = 2", 1, true), hover and hover.contents.value:match("param s = %d"))
seek("as crossed_leaves")
local place = ask("definition")
check("definition in the library", place and place.uri:find("crossed_leaves.mech"), place and place.uri:match("[^/]+$"))
check("the library can be opened", vim.fn.filereadable(vim.uri_to_fname(place.uri)) == 1)
seek("output curl")
local all = ask("references", { context = { includeDeclaration = true } })
check("references", #all == 2, #all .. " in two files")
local symbols = ask("documentSymbol")
check("outline", symbols[2].name == "finger" and #symbols[2].children > 30, symbols[1].name .. ", " .. symbols[2].name)
check("folding", #ask("foldingRange") >= 4)
local hints = ask("inlayHint", { range = { start = { line = 0, character = 0 }, ["end"] = { line = 999, character = 0 } } })
check("hints: values", #hints > 10, hints[1].label)
local solved = vim.tbl_filter(function(h) return h.label:find("→", 1, true) end, hints)
check("hints: optimised", #solved >= 9, solved[1] and solved[1].label)
check("semantic tokens", #ask("semanticTokens/full").data > 2000)
check("formatting", #ask("formatting", { options = { tabSize = 4, insertSpaces = true } }) == 0, "nothing to do")
open("hand.mech")
seek("span(index.curl")
place = ask("definition")
check("definition in an import", place and place.uri:find("finger.mech"), place and place.uri:match("[^/]+$"))
seek("merging palm")
local edit = ask("rename", { newName = "wrist" })
local files = vim.tbl_count(edit.changes)
check("rename", files == 2, files .. " files")
vim.wait(20000, function() return #vim.diagnostic.get(0) == 0 end, 50)
check("findings", codes() == "", "none")

say("a design with errors")
open("broken.mech")
vim.wait(20000, function() return #vim.diagnostic.get(0) > 0 end, 50)
check("findings", codes():find("E0001") and codes():find("E0201"), codes())
seek("let   half = 2.5 * r")
hover = ask("hover")
check("hover beside mistakes", hover and hover.contents.value:find("20 mm", 1, true))
seek("as crossed_leaves")
check("definition beside mistakes", ask("definition") ~= vim.NIL)
-- Typing: a finding goes when its mistake is mended, and formatting touches one line.
for i, line in ipairs(vim.api.nvim_buf_get_lines(0, 0, -1, false)) do
  line = line:gsub("point O = %(0 mm, 0 mm$", "point O = (0 mm, 0 mm)"):gsub("over 2 mm$", "over 2 s")
  line = line:gsub("^    material rigur$", "  material   rigur")
  if vim.api.nvim_buf_get_lines(0, i - 1, i, false)[1] ~= line then
    vim.api.nvim_buf_set_lines(0, i - 1, i, false, { line })
  end
end
vim.wait(20000, function() return #vim.diagnostic.get(0) == 0 end, 50)
check("findings, mended", codes() == "", "none")
local edits = ask("formatting", { options = { tabSize = 4, insertSpaces = true } })
check("formatting", #edits == 1 and edits[1].newText == "    material rigur\n", "one line")
seek("export stl")
vim.api.nvim_buf_set_lines(0, -2, -2, false, { "    hinge h: base to " })
vim.api.nvim_win_set_cursor(0, { vim.api.nvim_buf_line_count(0) - 1, 21 })
local params = vim.lsp.util.make_position_params()
params.position.character = 21
local found = ask("completion", { position = params.position })
local labels = table.concat(vim.tbl_map(function(i) return i.label end, found), " ")
check("completion", labels:find("rocker") and not labels:find("nema17"), labels)
vim.api.nvim_buf_set_lines(0, -3, -2, false, { "    let y = polar(1 mm, " })
local signature = ask("signatureHelp", { position = { line = params.position.line, character = 24 } })
check("signature", signature and signature.activeParameter == 1, signature and signature.signatures[1].label)
vim.lsp.stop_client(client)
say("all is well")
vim.cmd("qall!")
