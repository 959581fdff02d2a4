-- Asks the language server everything through a real editor: `nvim --headless -u NONE -l` is newer than some, so
--   FLEXURA=target/release/flexura FOLDER=… nvim --headless -u NONE -c 'luafile tests/external/editor.lua'
-- FOLDER holds finger.mech, hand.mech and flap.mech (designs with imports), broken.mech (one with errors) and long.mech (one
-- that is not built in minutes). Writes a transcript to the standard output; ends with exit code 1 at the first answer that
-- is not as it should be.

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

-- Sends a command to the server; gives its answer, its error, and the number of the request.
local function command(name, wait)
  local params = { command = "flexura." .. name, arguments = { vim.uri_from_bufnr(0) } }
  local done, answer, why
  local _, id = vim.lsp.get_client_by_id(client).request("workspace/executeCommand", params, function(e, a)
    done, answer, why = true, a, e
  end, 0)
  if wait then
    vim.wait(60000, function() return done end, 20)
    if not done then fail(name .. ": no answer") end
  end
  return answer, why and why.message, id, function() return done, why end
end

-- Actions for the line of the cursor.
local function actions(only)
  local line = vim.api.nvim_win_get_cursor(0)[1] - 1
  return ask("codeAction", {
    range = { start = { line = line, character = 0 }, ["end"] = { line = line, character = 300 } },
    context = { diagnostics = {}, only = only },
  }) or {}
end

local function titles(all)
  return table.concat(vim.tbl_map(function(a) return a.title or a.command.title end, all), ", ")
end

local function line() return vim.api.nvim_get_current_line() end

-- How many lines of the buffer are not as they were.
local function changed(before)
  local now, n = vim.api.nvim_buf_get_lines(0, 0, -1, false), 0
  for i = 1, math.max(#now, #before) do
    if now[i] ~= before[i] then n = n + 1 end
  end
  return n
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
check("prepare rename", ask("prepareRename") ~= nil, "palm")
check("highlights", #ask("documentHighlight") >= 5)
check("outline of an assembly", ask("documentSymbol")[1].name == "hand")
check("folding of an assembly", #ask("foldingRange") >= 1)
check("tokens of an assembly", #ask("semanticTokens/full").data > 300)

say("a design with imports, at work")
open("flap.mech")
vim.wait(20000, function() return codes():find("W1107") end, 50)
check("findings of the mechanism", codes():find("W0101") and codes():find("W1107"), codes())
seek("material own")
place = ask("definition")
check("definition in an import", place.uri:find("parts.mech"), place.uri:match("[^/]+$"))
local before = vim.api.nvim_buf_get_lines(0, 0, -1, false)
seek("use std.flexures.wire")
local found = actions()
check("code actions", titles(found):find("Remove it") and titles(found):find("safe repair"), titles(found))
vim.lsp.util.apply_workspace_edit(found[1].edit, "utf-16")
check("a repair", #before - vim.api.nvim_buf_line_count(0) == 1 and not codes():find("E0"), "one line goes")
vim.cmd("undo")
before = vim.api.nvim_buf_get_lines(0, 0, -1, false)
local lenses = ask("codeLens")
check("code lenses", titles(lenses):find("Build") and titles(lenses):find("Show the report"), titles(lenses))
local _, why = command("applyOptimised", true)
check("nothing to apply yet", why and why:find("no lock"), why)
vim.cmd("silent write!")
local answer
answer, why = command("simulate", true)
check("simulate", answer and answer.good, answer and answer.summary or why)
check("it wrote nothing", vim.fn.isdirectory(folder .. "/out") == 0 and vim.fn.filereadable(folder .. "/flap.lock") == 0)
answer, why = command("build", true)
check("build", answer and answer.good and #answer.files >= 3, answer and answer.summary or why)
check("it wrote lock and parts", vim.fn.filereadable(folder .. "/flap.lock") == 1 and vim.fn.isdirectory(folder .. "/out") == 1)
vim.wait(20000, function() return codes():find("W13") end, 50)
check("findings of the solver", codes():find("W13"), codes())
answer, why = command("showReport", true)
check("report", answer and vim.fn.filereadable(answer.report) == 1, answer and answer.report:match("[^/]+$") or why)
seek("hinge bend")
found = actions({ "refactor" })
check("one optimised value", titles(found):find("optimised"), titles(found))
answer, why = command("applyOptimised", true)
vim.wait(5000, function() return changed(before) > 0 end, 20)
check("apply the optimised values", changed(before) == 1 and not line():find("free 0.8 mm"), answer and answer.summary or why)
vim.cmd("undo")
answer, why = command("betterRest", true)
vim.wait(5000, function() return vim.fn.search("rest bend at 10 deg", "n") > 0 end, 20)
check("the better rest pose", vim.fn.search("rest bend at 10 deg", "n") > 0, answer and answer.summary or why)
vim.wait(20000, function() return not codes():find("W1107") end, 50)
check("its finding goes", not codes():find("W1107"), codes())

say("a build of minutes, cancelled")
open("long.mech")
vim.wait(20000, function() return codes():find("W1107") end, 50)
local _, _, id, ended = command("build")
vim.wait(1500, function() return false end, 50)
local began = vim.loop.hrtime()
for _ = 1, 20 do ask("documentSymbol") end
local took = (vim.loop.hrtime() - began) / 1e6
check("answers meanwhile", not ended() and took < 2000, string.format("20 in %.0f ms", took))
vim.lsp.get_client_by_id(client).cancel_request(id)
-- This editor keeps the answer to itself. Where the first build has ended, another one can begin.
local again
for _ = 1, 50 do
  local _, _, other, refused = command("build")
  vim.wait(200, function() return (refused()) end, 20)
  if not refused() then again = other; break end
end
check("cancelled", again ~= nil, "another build can begin")
vim.lsp.get_client_by_id(client).cancel_request(again)
vim.wait(200, function() return false end, 20)
check("nothing is left", vim.fn.filereadable(folder .. "/long.lock") == 0)

say("a design with errors")
open("broken.mech")
vim.wait(20000, function() return #vim.diagnostic.get(0) > 0 end, 50)
check("findings", codes():find("E0001") and codes():find("E0201"), codes())
seek("let   half = 2.5 * r")
hover = ask("hover")
check("hover beside mistakes", hover and hover.contents.value:find("20 mm", 1, true))
seek("as crossed_leaves")
check("definition beside mistakes", ask("definition") ~= vim.NIL)
check("outline beside mistakes", #ask("documentSymbol")[1].children > 15)
check("folding beside mistakes", #ask("foldingRange") >= 2)
check("tokens beside mistakes", #ask("semanticTokens/full").data > 500)
local all_hints = { range = { start = { line = 0, character = 0 }, ["end"] = { line = 999, character = 0 } } }
check("hints beside mistakes", #ask("inlayHint", all_hints) > 0)
seek("hinge knee:  coupler")
check("references beside mistakes", #ask("references", { context = { includeDeclaration = true } }) >= 4)
local renaming = ask("rename", { newName = "bar" })
check("rename beside mistakes", renaming and vim.tbl_count(renaming.changes) == 1)
seek("P on couplerr")
found = actions({ "quickfix" })
check("code actions", #found == 1 and found[1].title:find("`coupler`"), titles(found))
before = vim.api.nvim_buf_get_lines(0, 0, -1, false)
vim.lsp.util.apply_workspace_edit(found[1].edit, "utf-16")
check("a repair", changed(before) == 1 and line():find("P on coupler$"), "one letter")
-- This editor tells changes a little later.
vim.wait(400, function() return false end, 20)
_, why = command("build", true)
check("build refused", why and why:find("not saved"), why)
-- Requests that are cancelled before they could be answered are refused (of which this editor says nothing), all others
-- answered.
local answered, cancelled, sent = 0, 0, 0
for i = 1, 60 do
  local here = { textDocument = vim.lsp.util.make_text_document_params() }
  local last = function(e) if not e then answered = answered + 1 end end
  local _, number = vim.lsp.get_client_by_id(client).request("textDocument/semanticTokens/full", here, last, 0)
  sent = sent + 1
  if i % 2 == 0 then
    vim.lsp.get_client_by_id(client).cancel_request(number)
    cancelled = cancelled + 1
  end
end
ask("documentSymbol")
vim.wait(500, function() return answered == sent end, 20)
check("cancelled requests", answered < sent and answered >= sent - cancelled, string.format("%d of %d answered, %d cancelled", answered, sent, cancelled))
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
found = ask("completion", { position = params.position })
local labels = table.concat(vim.tbl_map(function(i) return i.label end, found), " ")
check("completion", labels:find("rocker") and not labels:find("nema17"), labels)
vim.api.nvim_buf_set_lines(0, -3, -2, false, { "    let y = polar(1 mm, " })
local signature = ask("signatureHelp", { position = { line = params.position.line, character = 24 } })
check("signature", signature and signature.activeParameter == 1, signature and signature.signatures[1].label)
vim.lsp.stop_client(client)

say("the tree-sitter grammar")
vim.opt.runtimepath:prepend(folder .. "/nvim")
vim.treesitter.require_language("flexura", folder .. "/nvim/parser/flexura.so")
for _, name in ipairs({ "hand.mech", "finger.mech", "flap.mech" }) do
  vim.cmd("edit! " .. folder .. "/" .. name)
  local root = vim.treesitter.get_parser(0, "flexura"):parse()[1]:root()
  local colours, folds = 0, 0
  for _ in vim.treesitter.get_query("flexura", "highlights"):iter_captures(root, 0, 0, -1) do colours = colours + 1 end
  for _ in vim.treesitter.get_query("flexura", "folds"):iter_captures(root, 0, 0, -1) do folds = folds + 1 end
  check(name, not root:has_error() and colours > 100 and folds > 0, colours .. " colours, " .. folds .. " folds")
end
say("all is well")
vim.cmd("qall!")
