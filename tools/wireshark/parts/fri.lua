-- FRI: bare (1.x, 2.5) or between length and CRC (2.7); which of both a packet shows by itself.

local fri = make_protocol("fri", "KUKA Fast Robot Interface", {FRI_MONITORING, FRI_COMMAND}, {
  length = ProtoField.uint32("fri.frame.length", "Length of the message"),
  crc = ProtoField.uint32("fri.frame.crc", "CRC-32", base.HEX),
  answer_to = ProtoField.framenum("fri.answer_to", "Answer to", base.NONE, frametype.REQUEST),
  answer_latency = ProtoField.relative_time("fri.answer_latency", "Answer latency"),
})
local fri_crc_wrong = ProtoExpert.new("fri.frame.crc_wrong", "CRC wrong", expert.group.CHECKSUM, expert.severity.ERROR)
local fri_length_wrong =
  ProtoExpert.new("fri.frame.length_wrong", "Length wrong", expert.group.MALFORMED, expert.severity.ERROR)
fri.proto.experts = {fri.malformed, fri_crc_wrong, fri_length_wrong}

-- Monitoring messages whose answers may still come, by conversation and sequence counter: the last 4096 of each.
local ANSWERABLE = 4096
-- An older message with the same counter is of another session, and the one that was answered is not in the capture.
local LONGEST_LATENCY_S = 10
local fri_sent = {}
-- What was found in the first pass, because Wireshark dissects a packet again whenever it shows it.
local fri_answers = {}

function fri.proto.init()
  fri_sent, fri_answers = {}, {}
end

-- The message identifier of the message that begins at `at`; nil where none does.
local function fri_identifier(raw, at)
  if raw:byte(at + 1) ~= 0x0A or raw:byte(at + 3) ~= 0x08 then return nil end
  local low, high = read_varint(raw, at + 3, #raw)
  return low and high == 0 and low or nil
end

local function is_known(identifier)
  return identifier == FRI_MONITORING_IDENTIFIER or identifier == FRI_COMMAND_IDENTIFIER
end

local function is_fri(raw)
  return is_known(fri_identifier(raw, 4)) or is_known(fri_identifier(raw, 0))
end

-- Shows length and CRC; returns where the message is.
local function add_frame(branch, tvb, raw, problems)
  local length = little_endian(raw, 0)
  local stop = math.min(4 + length, #raw)
  local item = branch:add_le(fri.handles.length, tvb(0, 4))
  if length + 8 ~= tvb:reported_len() then
    item:add_proto_expert_info(
      fri_length_wrong,
      string.format("The length says %d bytes, the packet has room for %d", length, tvb:reported_len() - 8)
    )
  end
  if stop + 4 > #raw then
    problems[#problems + 1] = {at = #raw, text = "the CRC is cut off"}
    return stop, ""
  end
  item = branch:add_le(fri.handles.crc, tvb(stop, 4))
  local crc = crc32(raw, 4, stop)
  if crc == little_endian(raw, stop) then return stop, "" end
  item:add_proto_expert_info(fri_crc_wrong, string.format("The message has CRC 0x%08x", crc))
  return stop, " [CRC wrong]"
end

local function conversation(from, from_port, to, to_port)
  return string.format("%s:%d>%s:%d", tostring(from), from_port, tostring(to), to_port)
end

local function remember(pinfo, counter)
  local key = conversation(pinfo.src, pinfo.src_port, pinfo.dst, pinfo.dst_port)
  fri_sent[key] = fri_sent[key] or {}
  fri_sent[key][counter % ANSWERABLE] = {counter = counter, number = pinfo.number, at_s = pinfo.rel_ts}
end

local function find_answered(pinfo, counter)
  local sent = fri_sent[conversation(pinfo.dst, pinfo.dst_port, pinfo.src, pinfo.src_port)]
  local message = sent and sent[counter % ANSWERABLE]
  if not message or message.counter ~= counter or pinfo.rel_ts - message.at_s > LONGEST_LATENCY_S then return end
  local latency_ns = math.floor((pinfo.rel_ts - message.at_s) * 1e9 + 0.5)
  local seconds = math.floor(latency_ns / 1e9)
  fri_answers[pinfo.number] = {
    number = message.number,
    latency = NSTime.new(seconds, math.floor(latency_ns - seconds * 1e9)),
  }
end

local function add_answered(branch, pinfo)
  local answered = fri_answers[pinfo.number]
  if not answered then return end
  branch:add(fri.handles.answer_to, answered.number):set_generated()
  branch:add(fri.handles.answer_latency, answered.latency):set_generated()
end

local function enumerated(nodes, name)
  local node = last(nodes, name)
  if not node then return "" end
  local number = signed(node.low)
  return " " .. (node.field.names[number] or string.format("%s %d", name, number))
end

local function counter_text(nodes, name)
  local node = last(nodes, name)
  return node and string.format("#%.0f", node.low) or "#?"
end

local function parts_of(node)
  local names = {}
  for _, inner in ipairs(node and node.nodes or {}) do
    local name = inner.field and inner.field.name
    if name and names[#names] ~= name then names[#names + 1] = name end
  end
  return #names > 0 and ": " .. table.concat(names, ", ") or ""
end

local function fri_column(nodes, header, identifier)
  local number = counter_text(header, "sequence_counter")
  if identifier == FRI_MONITORING_IDENTIFIER then
    local connection = last(nodes, "connection")
    connection = connection and connection.nodes
    return "FRI monitoring " .. number .. enumerated(connection, "session_state") .. enumerated(connection, "quality")
  end
  local answered = counter_text(header, "reflected_sequence_counter")
  return "FRI command " .. number .. " answers " .. answered .. parts_of(last(nodes, "command"))
end

local function dissect_fri(tvb, pinfo, tree)
  local raw = tvb:raw()
  local framed = is_known(fri_identifier(raw, 4))
    or #raw >= 8 and little_endian(raw, 0) + 8 == tvb:reported_len() and not is_known(fri_identifier(raw, 0))
  local identifier = fri_identifier(raw, framed and 4 or 0)
  local branch = tree:add(fri.proto, tvb())
  local problems, from, stop, note = {}, 0, #raw, ""
  if framed then
    from = 4
    stop, note = add_frame(branch, tvb, raw, problems)
  end
  local column
  if is_known(identifier) then
    local message = identifier == FRI_MONITORING_IDENTIFIER and FRI_MONITORING or FRI_COMMAND
    local nodes = parse(message, raw, from, stop, problems)
    local header = last(nodes, "header")
    header = header and header.nodes
    add_nodes(branch, tvb, fri, nodes)
    column = fri_column(nodes, header, identifier)
    local counter = last(header, message == FRI_MONITORING and "sequence_counter" or "reflected_sequence_counter")
    if counter and not pinfo.visited then
      local note_down = message == FRI_MONITORING and remember or find_answered
      note_down(pinfo, counter.low)
    end
    add_answered(branch, pinfo)
  else
    local what = identifier and string.format("the unknown message identifier 0x%x", identifier) or "no message identifier"
    problems[1] = {at = from, text = what .. ", so this is no message of FRI"}
    column = "FRI ?"
  end
  note = note .. add_problems(branch, tvb, fri, problems)
  branch:append_text(", " .. column:gsub("^FRI ", "") .. note)
  pinfo.cols.protocol:set("FRI")
  pinfo.cols.info:set(column .. note)
end
