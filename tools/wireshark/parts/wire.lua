-- Protobuf on the wire: bytes to nodes, with nothing of Wireshark's. Offsets count from 0, as Wireshark's do.
--
-- A node is {field, from, to}: from its tag to its end. A message has its nodes in `nodes`; a number of a varint is in
-- `low` and `high`, 32 bits each; anything else stands in the bytes from `at` to `to`. Repeated numbers of one message
-- are one node with `elements`, packed or not. A node without a field is of a number or a form the schema does not know.

local WIRE_TYPES = {
  double = 1, float = 5, uint32 = 0, int32 = 0, uint64 = 0, bool = 0, fixed64 = 1, sfixed64 = 1,
  string = 2, bytes = 2, message = 2, vector = 2,
}
local UTF8 = {
  "[\194-\223][\128-\191]",
  "\224[\160-\191][\128-\191]",
  "[\225-\236\238\239][\128-\191][\128-\191]",
  "\237[\128-\159][\128-\191]",
  "\240[\144-\191][\128-\191][\128-\191]",
  "[\241-\243][\128-\191][\128-\191][\128-\191]",
  "\244[\128-\143][\128-\191][\128-\191]",
}
local POWERS = {1, 128, 16384, 2097152}

-- Returns both halves of a varint and where it ends; nil and what is wrong.
local function read_varint(raw, at, stop)
  local low, high = 0, 0
  for index = 0, 9 do
    if at + index >= stop then return nil, "a number that is cut off" end
    local byte = raw:byte(at + index + 1)
    local bits = byte % 128
    if index < 4 then
      low = low + bits * POWERS[index + 1]
    elseif index == 4 then
      low = low + bits % 16 * 268435456
      high = (bits - bits % 16) / 16
    elseif index < 9 then
      high = high + bits * POWERS[index - 4] * 8
    else
      high = high + bits % 2 * 2147483648
    end
    if byte < 128 then return low, high, at + index + 1 end
  end
  return nil, "a number of more than ten bytes"
end

-- Returns where the value of a field begins and ends, and the halves of a varint; nil and what is wrong.
local function measure(raw, wire_type, at, stop)
  if wire_type == 0 then
    local low, high, to = read_varint(raw, at, stop)
    if not low then return nil, high end
    return at, to, low, high
  end
  local size
  if wire_type == 1 then
    size = 8
  elseif wire_type == 5 then
    size = 4
  elseif wire_type == 2 then
    local high, value_at
    size, high, value_at = read_varint(raw, at, stop)
    if not size then return nil, high end
    if high > 0 then return nil, "four gigabytes or more are announced" end
    at = value_at
  else
    return nil, string.format("wire type %d, which FRI and the servo link do not use", wire_type)
  end
  if at + size > stop then
    return nil, string.format("%.0f bytes are announced, %d are left", size, stop - at)
  end
  return at, at + size
end

local function is_utf8(text)
  for _, character in ipairs(UTF8) do text = text:gsub(character, "?") end
  return not text:find("[\128-\255]")
end

local function add_element(elements, from, to, at, low, high)
  elements[#elements + 1] = {from = from, to = to, at = at, low = low, high = high}
end

-- Adds the numbers of a packed field; returns false at one that is cut off.
local function unpack_elements(raw, field, at, to, elements, problems)
  while at < to do
    local value_at, stop, low, high = measure(raw, WIRE_TYPES[field.kind], at, to)
    if not value_at then
      problems[#problems + 1] = {at = at, text = field.path .. ": " .. stop}
      return false
    end
    add_element(elements, at, stop, at, low, high)
    at = stop
  end
  return true
end

-- Returns the nodes of the message in the bytes from `at` to `stop`. What cannot be read is added to `problems`, and
-- ends its message. `frozen_only`: fields that may mean something else in other versions count as unknown.
local function parse(message, raw, at, stop, problems, frozen_only)
  local nodes, found, start = {}, {}, at
  local function fail(where, text)
    problems[#problems + 1] = {at = where, text = text}
    return nodes
  end
  while at < stop do
    local from = at
    local tag, tag_high, after_tag = read_varint(raw, at, stop)
    if not tag then return fail(from, tag_high) end
    local wire_type = tag % 8
    local number = (tag - wire_type) / 8
    if number == 0 or tag_high > 0 then return fail(from, "a field number that cannot be") end
    local value_at, to, low, high = measure(raw, wire_type, after_tag, stop)
    if not value_at then return fail(from, string.format("field %d: %s", number, to)) end

    local field = message.fields[number]
    if field and frozen_only and not field.frozen then field = nil end
    local fits = field and wire_type == WIRE_TYPES[field.kind]
    local numbers = field and field.repeated and not field.message
    local packed = numbers and wire_type == 2
    if not fits and not packed then
      nodes[#nodes + 1] = {number = number, wire_type = wire_type, from = from, to = to}
    elseif numbers then
      local node = found[number]
      if not node then
        node = {field = field, from = from, elements = {}}
        nodes[#nodes + 1] = node
        found[number] = node
      end
      node.to = to
      if not packed then
        add_element(node.elements, from, to, value_at, low, high)
      elseif not unpack_elements(raw, field, value_at, to, node.elements, problems) then
        return nodes
      end
    else
      local node = {field = field, from = from, to = to, at = value_at, low = low, high = high}
      if field.message then node.nodes = parse(field.message, raw, value_at, to, problems, frozen_only) end
      if field.kind == "string" and not is_utf8(raw:sub(value_at + 1, to)) then
        fail(value_at, field.path .. " is no UTF-8")
      end
      nodes[#nodes + 1] = node
      found[number] = node
    end
    at = to
  end
  for _, number in ipairs(message.required or {}) do
    if not found[number] then fail(start, message.fields[number].path .. " is missing") end
  end
  return nodes
end

-- The last node of a field, which is the one that counts; nil without.
local function last(nodes, name)
  for index = #(nodes or {}), 1, -1 do
    local node = nodes[index]
    if node.field and node.field.name == name then return node end
  end
  return nil
end

-- CRC-32 as zlib computes it. Bits that overflow are harmless: only the low 32 count, whatever sign the library gives.
local xor = bit and bit.bxor or load("return function(a, b) return a ~ b end")()
local CRC_TABLE = {}
for index = 0, 255 do
  local crc = index
  for _ = 1, 8 do
    local odd = crc % 2
    crc = (crc - odd) / 2
    if odd == 1 then crc = xor(crc, 0xEDB88320) % 4294967296 end
  end
  CRC_TABLE[index] = crc
end

local function crc32(raw, from, to)
  local crc = 4294967295
  for index = from + 1, to do
    local low = crc % 256
    crc = xor(CRC_TABLE[xor(low, raw:byte(index))], (crc - low) / 256) % 4294967296
  end
  return 4294967295 - crc
end

local function little_endian(raw, at)
  local a, b, c, d = raw:byte(at + 1, at + 4)
  return a + b * 256 + c * 65536 + d * 16777216
end
