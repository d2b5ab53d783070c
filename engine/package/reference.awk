# A header as Doxygen reads it: its plain comments become documentation. Every line stays where it is, so warnings name the right one.
#   before `#pragma once`              the file's, and that of the class of the file's name
#   before or behind a declaration     that declaration's; behind `int a, b;` that of each
#   within a function, behind a forward declaration, `// Heading`, `// Heading:`   nobody's
#   from `// Internal.` to an empty line   left out, with what is there
#   indented by three                  code if its first line ends as code does, else items: `key: text` or `key  text`; deeper lines go on
# A page of the guide: links that leave it become text.
function flush(text) {
  if (NR > 1) print held
  held = text
}
function leave_run() {
  if (run == "code") held = held " \\endcode"
  if (run == "list") held = held " </ul>"
  run = ""
}
BEGIN { head = 1 }
FILENAME ~ /\.md$/ {
  while (match($0, /\[[^]]*\]\(\.\.\/[^)]*\)/)) {
    split(substr($0, RSTART + 1, RLENGTH - 2), link, /\]\(/)
    gsub(/^(\.\.\/)*|#.*/, "", link[2])
    told = link[1] ~ /\.h$/ || link[1] == link[2] ? link[1] : link[1] " in " link[2]
    $0 = substr($0, 1, RSTART - 1) told substr($0, RSTART + RLENGTH)
  }
  print
  next
}
{ line = $0; code = line; sub(/ *\/\/.*/, "", code); comment = substr(line, length(code) + 1) }

# A line of comment alone.
comment != "" && code == "" && !body {
  at = index(line, "//")
  text = substr(line, at + 2)
  indent = match(text, /[^ ]/) - 1
  if (at == behind) { flush(substr(line, 1, at - 1) "///<" text); next }
  if (text == " Internal.") { internal = 1; flush("/// \\cond"); next }
  if (text ~ /^ [A-Z][a-z]+( [a-z]+)?:?$/ && !head) { flush(line); next }
  if (indent < 3) leave_run()
  else if (run == "") {
    run = text ~ /[;{]$/ ? "code" : "list"
    held = held (run == "code" ? " \\code{.cpp}" : " <ul>")
  }
  if (run == "list" && indent == 3) {
    if (match(text, /^ +[a-z]+(: |  )/)) text = "<b>" substr(text, 4, RLENGTH - 5) "</b>" substr(text, RLENGTH - 1)
    text = " <li>" text
  }
  flush(substr(line, 1, at - 1) "///" text)
  next
}

{
  leave_run()
  behind = 0
  if (line == "#pragma once") { line = "/// \\file"; head = 0 }
  else if (!body && code != "") {
    # What a class of the file's name is, its head tells.
    if (held == "" && match(code, /^(class|struct) [A-Za-z]+ [{]/)) {
      name = code; gsub(/^(class|struct) | [{].*/, "", name)
      file = FILENAME; sub(/.*\/islet\//, "islet/", file)
      stem = file; sub(/.*\//, "", stem); gsub(/_|\.h/, "", stem)
      if (tolower(name) == stem) held = "/// \\copydoc " file
    }
    if (comment != "" && code !~ /^ *(class|struct) [A-Za-z]+;|^#|^[}]/) {
      behind = index(line, "//")
      line = ""
      rest = code
      while (code !~ /\(/ && code ~ /;$/ && match(rest, /, [A-Za-z_]+( =|[{,;])/)) {
        line = line substr(rest, 1, RSTART) " /**<" substr(comment, index(comment, "//") + 2) " */"
        rest = substr(rest, RSTART + 1)
      }
      sub(/\/\//, "///<", comment)
      line = line rest comment
    }
  }
  if (internal && line == "") { internal = 0; line = "/// \\endcond" }
  opened = gsub(/[{]/, "", code) - gsub(/[}]/, "", code)
  if (body || (opened > 0 && code !~ /^ *(namespace|class|struct|enum) /)) body += opened
  flush(line)
}
END { if (FILENAME !~ /\.md$/) print held }
