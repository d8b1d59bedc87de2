-- The servo link: one byte of framing, a packet, and a tag where there is a pre-shared key.

local servo = make_protocol("servo", "fri-hil servo link", {SERVO_PACKET}, {
  framing = ProtoField.uint8("servo.framing", "Framing", base.HEX, {[SERVO_BARE] = "no tag", [SERVO_TAGGED] = "tag"}),
  tag = ProtoField.bytes("servo.tag", "Tag (BLAKE2b, not checked)"),
})
servo.proto.experts = {servo.malformed}

local function packet_end(raw)
  return raw:byte(1) == SERVO_TAGGED and #raw - SERVO_TAG_BYTES or #raw
end

-- The protocol version of a packet; nil where there is no header that says one.
local function servo_version(raw)
  local framing = raw:byte(1)
  if framing ~= SERVO_BARE and framing ~= SERVO_TAGGED then return nil end
  if raw:byte(2) ~= 0x0A or raw:byte(4) ~= 0x08 then return nil end
  local low, high = read_varint(raw, 4, packet_end(raw))
  return low and low > 0 and high == 0 and low or nil
end

-- Whether the bytes are fields of a packet from the first to the last: a header and one body.
local function is_servo(raw)
  if not servo_version(raw) then return false end
  local at, stop, bodies = 1, packet_end(raw), 0
  while at < stop do
    local tag = raw:byte(at + 1)
    local field = tag % 8 == 2 and SERVO_PACKET.fields[(tag - 2) / 8]
    local found, to
    if field then found, to = measure(raw, 2, at + 1, stop) end
    if not found then return false end
    if at > 1 then bodies = bodies + 1 end
    at = to
  end
  return bodies == 1
end

local function text_of(tvb, nodes, name)
  local node = last(nodes, name)
  return node and node.to > node.at and plain(tvb:raw(node.at, node.to - node.at)) or ""
end

local function fixed_text(tvb, nodes, name)
  local node = last(nodes, name)
  return node and tostring(tvb(node.at, 8):le_uint64()) or "0"
end

local function name_of(nodes, name)
  local node = last(nodes, name)
  local number = node and signed(node.low) or 0
  local field = node and node.field
  return field and field.names and field.names[number] or string.format("%d", number)
end

local function what_of(nodes, name)
  local kinds = {}
  for _, node in ipairs(nodes) do
    if node.field and node.field.name == name then
      local kind = "?"
      for _, inner in ipairs(node.nodes) do
        if inner.nodes then kind = inner.field.name end
      end
      kinds[#kinds + 1] = kind
    end
  end
  return #kinds > 0 and ": " .. table.concat(kinds, ", ") or ""
end

local function numbered(tvb, header)
  return "#" .. fixed_text(tvb, header, "sequence")
end

local function reflecting(tvb, header)
  return numbered(tvb, header) .. " reflects #" .. fixed_text(tvb, header, "reflected_sequence")
end

local SERVO_COLUMNS = {
  hello = function(tvb, _, body) return name_of(body, "role") .. " " .. text_of(tvb, body, "name") end,
  welcome = function(tvb, _, body) return text_of(tvb, body, "software") .. " " .. text_of(tvb, body, "robot") end,
  refused = function(tvb, _, body) return text_of(tvb, body, "reason") end,
  ended = function(tvb, _, body) return text_of(tvb, body, "reason") end,
  goodbye = function(tvb, header) return numbered(tvb, header) end,
  command = function(tvb, header, body) return reflecting(tvb, header) .. what_of(body, "request") end,
  state = function(tvb, header, body)
    local snapshot = last(body, "snapshot")
    local cycle = snapshot and " cycle " .. fixed_text(tvb, snapshot.nodes, "cycle") or ""
    return reflecting(tvb, header) .. cycle .. what_of(body, "report")
  end,
}

local function servo_column(tvb, nodes)
  local header = last(nodes, "header")
  header = header and header.nodes or {}
  for index = #nodes, 1, -1 do
    local node = nodes[index]
    local describe = node.field and SERVO_COLUMNS[node.field.name]
    if describe then return "servo " .. node.field.name .. " " .. describe(tvb, header, node.nodes) end
  end
  return "servo ?"
end

local function dissect_servo(tvb, pinfo, tree)
  local raw = tvb:raw()
  local branch = tree:add(servo.proto, tvb())
  local problems, column, note = {}, "servo ?", ""
  local version, framing, stop = servo_version(raw), raw:byte(1), packet_end(raw)
  branch:add(servo.handles.framing, tvb(0, 1))
  if version then
    local nodes = parse(SERVO_PACKET, raw, 1, stop, problems, version ~= SERVO_VERSION)
    add_nodes(branch, tvb, servo, nodes)
    column = servo_column(tvb, nodes)
    if version ~= SERVO_VERSION then note = string.format(" [version %.0f: only what is frozen is read]", version) end
  elseif framing ~= SERVO_BARE and framing ~= SERVO_TAGGED then
    problems[1] = {at = 0, text = string.format("no packet of the servo link begins with 0x%02x", framing)}
  else
    problems[1] = {at = math.min(1, #raw - 1), text = "no protocol version"}
  end
  if framing == SERVO_TAGGED and stop > 1 then branch:add(servo.handles.tag, tvb(stop)) end
  note = note .. add_problems(branch, tvb, servo, problems)
  branch:append_text(", " .. column:gsub("^servo ", "") .. note)
  pinfo.cols.protocol:set("servo")
  pinfo.cols.info:set(column .. note)
end

-- Ports can be chosen freely on both links, so that one may stand on the usual port of the other.
function fri.proto.dissector(tvb, pinfo, tree)
  local raw = tvb:raw()
  if #raw == 0 then return 0 end
  local dissect = is_servo(raw) and not is_fri(raw) and dissect_servo or dissect_fri
  dissect(tvb, pinfo, tree)
end

function servo.proto.dissector(tvb, pinfo, tree)
  local raw = tvb:raw()
  if #raw == 0 then return 0 end
  local dissect = is_fri(raw) and not is_servo(raw) and dissect_fri or dissect_servo
  dissect(tvb, pinfo, tree)
end

register(fri, FRI_PORTS, "FRI", is_fri)
register(servo, SERVO_PORTS, "of the servo link", is_servo)
