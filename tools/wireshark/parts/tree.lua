-- Nodes to what Wireshark shows: fields, texts, experts.

local MOST_NUMBERS_SHOWN = 16

-- Returns text fit for a column, whatever a peer sent.
local function plain(text)
  if not is_utf8(text) then text = text:gsub("[\128-\255]", "?") end
  return (text:gsub("[\0-\31\127]", "?"))
end

local function signed(low)
  return low < 2147483648 and low or low - 4294967296
end

local function make_handle(field)
  local path, label, base_of = field.path, field.label, field.hexadecimal and base.HEX or base.DEC
  local kind = field.kind
  if kind == "message" then return ProtoField.none(path, label) end
  if kind == "double" then return ProtoField.double(path, label) end
  if kind == "float" then return ProtoField.float(path, label) end
  if kind == "uint32" then return ProtoField.uint32(path, label, base_of, field.names) end
  if kind == "int32" then return ProtoField.int32(path, label, base.DEC, field.names) end
  if kind == "uint64" or kind == "fixed64" then return ProtoField.uint64(path, label, base_of) end
  if kind == "sfixed64" then return ProtoField.int64(path, label) end
  if kind == "bool" then return ProtoField.bool(path, label) end
  if kind == "string" then return ProtoField.string(path, label, base.UNICODE) end
  return ProtoField.bytes(path, label)
end

-- Adds the ProtoFields of a message and of all below it to `handles`; what two messages share is one.
local function make_handles(message, handles)
  for _, field in pairs(message.fields) do
    if field.kind ~= "vector" and not handles[field.path] then handles[field.path] = make_handle(field) end
    if field.repeated and not field.message then
      local count = field.path .. ".count"
      handles[count] = handles[count] or ProtoField.uint32(count, field.label .. ", count")
    end
    if field.message then make_handles(field.message, handles) end
  end
end

-- What all messages of a protocol are shown with.
local function make_protocol(name, description, messages, more)
  local protocol = {proto = Proto(name, description), handles = more}
  for _, message in ipairs(messages) do make_handles(message, protocol.handles) end
  protocol.handles.unknown = ProtoField.bytes(name .. ".unknown", "Unknown field")
  protocol.malformed = ProtoExpert.new(name .. ".malformed", "Malformed", expert.group.MALFORMED, expert.severity.ERROR)
  protocol.proto.fields = protocol.handles
  return protocol
end

local function add_value(branch, tvb, handle, field, node)
  local kind, size = field.kind, node.to - node.at
  if kind == "double" or kind == "float" or kind == "fixed64" or kind == "sfixed64" then
    return branch:add_le(handle, tvb(node.at, size))
  elseif kind == "uint32" then
    return branch:add(handle, tvb(node.at, size), node.low)
  elseif kind == "int32" then
    return branch:add(handle, tvb(node.at, size), signed(node.low))
  elseif kind == "uint64" then
    return branch:add(handle, tvb(node.at, size), UInt64.new(node.low, node.high))
  elseif kind == "bool" then
    return branch:add(handle, tvb(node.at, size), node.low > 0 or node.high > 0)
  elseif kind == "string" then
    return branch:add_packet_field(handle, tvb(node.at, size), ENC_UTF_8)
  end
  return branch:add(handle, tvb(node.at, size))
end

local function number_text(tvb, field, element)
  if field.kind == "double" or field.kind == "float" then
    return string.format("%.6g", tvb(element.at, element.to - element.at):le_float())
  end
  local number = field.kind == "int32" and signed(element.low) or element.low
  return field.names and field.names[number] or string.format("%d", number)
end

-- Adds repeated numbers below their count. Texts only where somebody sees them: they cost more than the numbers.
local function add_numbers(branch, tvb, protocol, field, node)
  local count = branch:add(protocol.handles[field.path .. ".count"], tvb(node.from, node.to - node.from), #node.elements)
  local handle, visible, texts = protocol.handles[field.path], branch.visible, {}
  for index, element in ipairs(node.elements) do
    local item = add_value(count, tvb, handle, field, element)
    if visible then
      item:prepend_text(string.format("[%d] ", index))
      if index <= MOST_NUMBERS_SHOWN then
        texts[index] = number_text(tvb, field, element)
      elseif index == MOST_NUMBERS_SHOWN + 1 then
        texts[index] = "..."
      end
    end
  end
  if visible then count:set_text(field.label .. ": " .. (#texts > 0 and table.concat(texts, ", ") or "none")) end
end

local add_nodes

local function add_vector(branch, tvb, protocol, node)
  local element = node.field.message.fields[1]
  local numbers = {from = node.from, to = node.to, elements = {}}
  local others = {}
  for _, inner in ipairs(node.nodes) do
    if inner.elements then numbers.elements = inner.elements else others[#others + 1] = inner end
  end
  add_numbers(branch, tvb, protocol, element, numbers)
  add_nodes(branch, tvb, protocol, others)
end

function add_nodes(branch, tvb, protocol, nodes)
  for _, node in ipairs(nodes) do
    local field = node.field
    if not field then
      local item = branch:add(protocol.handles.unknown, tvb(node.from, node.to - node.from))
      item:prepend_text(string.format("Number %d, wire type %d: ", node.number, node.wire_type))
    elseif field.kind == "vector" then
      add_vector(branch, tvb, protocol, node)
    elseif node.elements then
      add_numbers(branch, tvb, protocol, field, node)
    elseif node.nodes then
      local inner = branch:add(protocol.handles[field.path], tvb(node.from, node.to - node.from))
      add_nodes(inner, tvb, protocol, node.nodes)
    else
      add_value(branch, tvb, protocol.handles[field.path], field, node)
    end
  end
end

-- Adds what could not be read, each at its offset; returns what the column says of it.
local function add_problems(branch, tvb, protocol, problems)
  if tvb:captured_len() < tvb:reported_len() then
    table.insert(problems, 1, {at = tvb:len(), text = "the recorder cut this packet"})
  end
  for _, problem in ipairs(problems) do
    local text = string.format("Malformed at byte %d: %s", problem.at, problem.text)
    local item = branch:add(tvb(problem.at, math.min(1, tvb:len() - problem.at)), text)
    item:add_proto_expert_info(protocol.malformed, text)
  end
  return #problems > 0 and " [malformed: " .. plain(problems[1].text) .. "]" or ""
end

-- Registers for ports that the user may change, and for any other port by what the packets look like.
local function register(protocol, ports, what, recognise)
  local proto = protocol.proto
  local udp_ports = DissectorTable.get("udp.port")
  local registered = ports
  proto.prefs.ports = Pref.range("UDP ports", ports, "Packets of these ports are " .. what .. " even when broken", 65535)
  udp_ports:add(registered, proto)
  function proto.prefs_changed()
    if proto.prefs.ports == registered then return end
    if registered ~= "" then udp_ports:remove(registered, proto) end
    registered = proto.prefs.ports
    if registered ~= "" then udp_ports:add(registered, proto) end
  end
  proto:register_heuristic("udp", function(tvb, pinfo, tree)
    if not recognise(tvb:raw()) then return false end
    proto.dissector(tvb, pinfo, tree)
    return true
  end)
end
