# The dependency rule of the house as a test: who may include what, read off every #include of the product.
#   cmake -DROOT=<project> -P tests/layering_test.cmake                checks the project
#   cmake -DSELF_TEST=<scratch dir> -P tests/layering_test.cmake       checks that a broken rule is found
# And what only one file may do, for everybody: the table `single` below; and which mutexes there are.
cmake_minimum_required(VERSION 3.25)

# The libraries, one row a folder, the deepest first; the project's own folders are below (rows):
#   header other libraries its headers may include; source: those only its .cpp files may, beside the former
# The standard library is always allowed; a library that no row names is refused, so that adding one is a decision.
set(folders server/storage server/mqtt server api/formats api/wire api drivers core/flight core/floor_plan core/nlos core/base core migrations)

# One row a subfolder, the lowest first: which project folders its files include, beside its own, and no others. A row
# names only folders whose rows stand above it, so that no arrow goes back up and there is no circle; and only those that
# a file of it does include. "api" and "server" are the files that stand in these folders themselves.
set(rows
  "core/base:"
  "core/types: core/base"
  "core/ports: core/base core/types"
  "core/geo: core/base core/types"
  "core/nlos: core/base"
  "core/ml: core/base core/nlos"
  "core/planning: core/base core/types core/geo"
  "core/localize: core/base core/types core/geo core/planning"
  "core/procedure: core/base core/types core/ports core/geo core/planning core/localize"
  "core/flight: core/base core/types core/ports core/geo core/planning core/localize core/procedure"
  "core/floor_plan: core/base"

  "drivers/link: core/base"
  "drivers/time: core/base drivers/link"
  "drivers/record: core/base drivers/link"
  "drivers/port: core/base core/types drivers/link"
  "drivers/gnss: core/base core/types drivers/time drivers/port"
  "drivers/ntrip: core/base core/types drivers/port"
  "drivers/pozyx: core/base drivers/time drivers/port"
  "drivers/dwm1001: core/base drivers/time drivers/port"
  "drivers/mapping: core/base drivers/time drivers/port"
  "drivers/mqtt: core/base drivers/time drivers/port drivers/mapping"
  "drivers/mavlink: core/base"
  "drivers/drone: core/base core/ports drivers/mavlink"
  "drivers/device: core/base core/types drivers/link drivers/time drivers/record drivers/port drivers/gnss drivers/ntrip drivers/pozyx drivers/dwm1001 drivers/mapping drivers/mqtt"
  "drivers/sim: core/base core/types drivers/pozyx drivers/mavlink drivers/drone"

  "api/kit: core/base core/types core/ports"
  "api/scope: core/base core/ports api/kit"
  "api/stream: core/base api/kit"
  "api/wire: core/base core/types core/geo core/localize core/flight api/kit"
  "api/formats: core/base core/types core/geo core/nlos core/ml core/planning core/localize api/kit api/wire"
  "api/admin: core/base core/types core/ports core/flight api/kit api/stream api/wire api/formats"
  "api/work: core/base core/ports api/kit api/admin"
  "api/devices: core/base core/types core/ports core/geo api/kit api/wire api/admin"
  "api/learning: core/base core/types core/ports core/nlos core/ml core/localize api/kit api/wire api/formats api/admin api/work"
  "api/missions: core/base core/types core/ports core/geo core/localize core/procedure core/flight api/kit api/stream api/wire api/admin api/devices"
  "api/measurements: core/base core/types core/ports api/kit api/wire api/formats api/admin api/learning api/missions"
  "api/anchors: core/base core/types core/ports core/geo core/localize api/kit api/wire api/formats api/admin api/missions"
  "api/planning: core/base core/types core/ports core/planning api/kit api/formats"
  "api/flight: core/base core/types core/ports core/geo core/planning core/localize core/procedure core/flight api/kit api/stream api/admin api/missions api/planning"
  "api/calibration: core/base core/types core/ports core/ml core/geo core/localize core/procedure api/kit api/stream api/wire api/formats api/admin api/work api/learning api/missions api/anchors"
  "api/exchange: core/base core/types core/ports core/geo core/localize api/kit api/anchors"
  "api/webhooks: core/base core/types core/ports api/kit api/admin"
  "api/mqtt: core/base core/ports api/kit api/stream api/anchors"
  "api/omlox: core/base core/types core/ports core/geo api/kit api/stream api/anchors api/webhooks"
  "api/places: core/base core/types core/ports core/geo core/floor_plan api/kit api/admin api/work"
  "api/bundles: core/base core/types core/ports api/kit api/wire api/formats api/admin api/planning"
  "api: core/base core/types core/ports core/geo core/localize api/kit api/scope api/stream api/wire api/admin api/work api/devices api/learning api/missions api/measurements api/anchors api/planning api/flight api/calibration api/exchange api/webhooks api/mqtt api/omlox api/places api/bundles"

  "migrations:"
  "server/storage: core/base core/types core/ports migrations"
  "server/mqtt: core/base core/ports"
  "server/runtime: core/base core/ports drivers/link drivers/record drivers/device api/work api/calibration api/places api server/storage"
  "server/tls: core/base"
  "server/http: core/base core/ports api/kit web server/runtime server/tls"
  "server/config: core/base server/http server/storage"
  "server/flight: core/base core/types core/ports core/geo core/planning core/localize core/procedure core/flight drivers/link drivers/mavlink drivers/drone drivers/sim"
  "server/app: core/base drivers/link drivers/drone api/kit api/stream api/admin api/learning api/mqtt api server/storage server/mqtt server/runtime server/tls server/http server/config server/flight"
  "server/gateway: core/base core/ports api/kit api/measurements server/storage server/runtime server/http"
  "server/sync: core/base core/geo api/kit api/formats api/measurements server/runtime server/http server/gateway"
  "server/cli: core/base core/types core/ports core/geo core/planning core/localize drivers/link drivers/gnss drivers/device drivers/sim api/kit api/wire api/formats api/admin api/learning api/measurements api/anchors api/calibration server/storage server/runtime server/tls server/http server/config server/flight server/app server/gateway server/sync"
  "server: core/base server/cli")
set(from_outside web)  # made by the build
set(everywhere "Eigen/|boost/outcome/")

set(core_header "^(${everywhere})")
set(core_source "^(ceres/|libsvm/|glog/|pthread\\.h$|opencv2/|GeographicLib/|proj\\.h$|sys/random\\.h$)")

# SHA-256 and base64, for everybody.
set(core/base_header "^(${everywhere})")
set(core/base_source "^(openssl/evp\\.h$|pthread\\.h$|sys/(random|stat)\\.h$|immintrin\\.h$)")

# Powers of impulse responses: what the compiler has no operator for.
set(core/nlos_header "^(${everywhere})")
set(core/nlos_source "^immintrin\\.h$")

# A live flight is deterministic: no library, and (rules below) no clock, thread or lock.
set(core/flight_header "^(${everywhere})")
set(core/flight_source "^$")

# Pictures of plans: decoders that run in the worker process alone.
set(core/floor_plan_header "^(${everywhere})")
set(core/floor_plan_source "^(opencv2/|png\\.h$|jpeglib\\.h$|jerror\\.h$|tiffio\\.h$)")

set(drivers_header "^(${everywhere}|boost/asio)")
# json: a device of ours speaks it on the wire (gpsd), and only its decoder knows.
set(drivers_source "^(nlohmann/json\\.hpp$|sys/|arpa/|netinet/|linux/|termios\\.h$|unistd\\.h$|fcntl\\.h$|grp\\.h$|poll\\.h$|pty\\.h$|stdlib\\.h$|time\\.h$)")

set(api_header "^(${everywhere}|nlohmann/json_fwd\\.hpp$)")
set(api_source "^(malloc\\.h$|nlohmann/json\\.hpp$|zlib\\.h$|openssl/|xxhash\\.h$)")
# Rows of bulk uploads are read by simdjson, all other JSON by nlohmann's.
set(api/wire_header "${api_header}")
set(api/wire_source "^(nlohmann/json\\.hpp$|simdjson\\.h$)")
set(api/formats_header "${api_header}")
set(api/formats_source "^(iconv\\.h$|nlohmann/json\\.hpp$|zlib\\.h$|zip\\.h$|pugixml\\.hpp$)")

set(server/storage_header "^(${everywhere})")
# Of JSON the one column that is GeoJSON.
set(server/storage_source "^(nlohmann/json\\.hpp$|sqlite3\\.h$|SQLiteCpp/|libpq-fe\\.h$|zlib\\.h$|sys/|unistd\\.h$|fcntl\\.h$)")

# The one folder that knows the library of MQTT.
set(server/mqtt_header "^(${everywhere})")
set(server/mqtt_source "^(mosquitto\\.h$|poll\\.h$|resolv\\.h$|sys/|unistd\\.h$)")

# Of JSON only its name, as in api.
set(server_header "^(${everywhere}|boost/|nlohmann/json_fwd\\.hpp$)")
set(server_source "^(CLI/|linux/(filter|landlock|seccomp|tcp)\\.h$|spawn\\.h$|httplib\\.h$|spdlog/|fmt/|prometheus/|openssl/|toml\\+\\+/|toml\\.hpp$|nlohmann/json|zlib\\.h$|sys/|netdb\\.h$|netinet/|arpa/|unistd\\.h$|fcntl\\.h$|signal\\.h$|poll\\.h$|pthread\\.h$|termios\\.h$)")

set(migrations_header "^$")
set(migrations_source "^$")

# What is done in one place: a regular expression on lines, the files that may, and why nobody else. Of a rule with
# _in only the files that match it are held to it.
set(single dump thread catch pure home)
set(pure_line "[a-z_]clock(::|\\(\\)\\.|\\.)now\\(|[cC]lock\\.now\\(|std::(recursive_|shared_)?mutex|Locked<|std::atomic|std::thread|std::condition_variable|make_uuid_v7")
set(pure_files "^$")
set(pure_in "^core/(flight|procedure|localize/live_)")
set(pure_why "a live flight is driven by calls that bring their time (core/flight/README.md): no clock, lock, thread or chance")
set(home_line "^ *(LiveFlight|(procedure::)?Flight(Control|Engine)|std::optional<procedure::FlightControl>) [a-z_]+[;({]")
set(home_files "^core/(flight|procedure|localize)/")
set(home_why "a live flight is held by core/flight alone")
set(dump_line "(\\.|->)dump\\(")
set(dump_files "^core/base/to_wire\\.hpp$")
set(dump_why "JSON is written by to_wire (core/base/to_wire.hpp): a bare dump() throws on bytes that are not UTF-8")
set(thread_line "std::(j?thread[^:]|async\\()|pthread_create")
set(thread_files "^core/base/guard\\.hpp$")
set(thread_why "a thread is a Thread (core/base/guard.hpp): what it throws beside the guard ends the server")
set(catch_line "catch \\(\\.\\.\\.\\)")
set(catch_files "^core/(base/guard\\.[ch]pp|ml/parallel\\.cpp)$")
set(catch_why "catching everything is guarded()'s (core/base/guard.hpp): there is no other door")

# Every std::mutex there is beside Locked's own, as FILE:NAME. Data that a lock guards lives inside it (core/base/locked.hpp);
# a plain mutex serialises an action, and its name says which.
set(mutex_line "std::[a-z_]*mutex +[a-z0-9_]+ *[;,{=]")
set(mutexes
  api/anchors/contradiction_watch.hpp:comparing_  # published anchors with later flights
  api/devices/device_stream.hpp:changing_         # whose the devices are: told to them and to the disk
  api/flight/flight_state.hpp:publishing_         # events of a flight, in their order
  api/kit/organization_index.hpp:rereading_       # a site or a quota, read and noted
  api/learning/model_registry.hpp:reloading_      # the promoted models
  api/missions/mission_service_state.hpp:correcting_one  # what was declared of a mission, read and written
  api/missions/mission_service_state.hpp:reading_one  # a flight read back from the store
  api/webhooks/webhook_service.hpp:starting_      # the threads of webhooks: begun or joined
  server/gateway/outbox.cpp:writing               # the outbox, with what a full disk owes
  server/runtime/backup_keeper.hpp:making_        # a backup
  server/runtime/device_manager.cpp:saving_       # devices.json
  server/runtime/worker_main.cpp:writing          # a frame to the server
  )

# mutexes_of(ROOT FILE OUT): those of a file, as above.
function(mutexes_of root file out)
  file(STRINGS "${root}/${file}" lines REGEX "${mutex_line}")
  set(found "")
  foreach(line IN LISTS lines)
    if(line MATCHES "std::[a-z_]*mutex +([a-z0-9_]+)")
      list(APPEND found "${file}:${CMAKE_MATCH_1}")
    endif()
  endforeach()
  set(${out} "${found}" PARENT_SCOPE)
endfunction()

# folder_of(PATH OUT): the row a path belongs to, its first two names, or the first where it stands in that folder itself.
function(folder_of path out)
  if(path MATCHES "^([^/]+/[^/]+)/")
    set(${out} "${CMAKE_MATCH_1}" PARENT_SCOPE)
  else()
    string(REGEX REPLACE "/.*" "" first "${path}")
    set(${out} "${first}" PARENT_SCOPE)
  endif()
endfunction()

# read_rows(ROWS OUT): what is wrong with the table itself; sets may_NAME for each row.
function(read_rows rows out)
  set(found "")
  set(known ${from_outside})
  foreach(row IN LISTS rows)
    string(REGEX MATCH "^([^:]+): *(.*)$" matched "${row}")
    set(name "${CMAKE_MATCH_1}")
    separate_arguments(may UNIX_COMMAND "${CMAKE_MATCH_2}")
    foreach(one IN LISTS may)
      if(NOT one IN_LIST known)
        list(APPEND found "the row of ${name} names ${one}, which has no row above it")
      endif()
    endforeach()
    list(APPEND known "${name}")
    set("may_${name}" "${may}" PARENT_SCOPE)
  endforeach()
  list(REMOVE_ITEM known ${from_outside})
  set(row_names "${known}" PARENT_SCOPE)
  set(${out} "${found}" PARENT_SCOPE)
endfunction()
read_rows("${rows}" rows_broken)

# idle_of(ROOT OUT): folders a row names although nothing includes them any more, parts of api whose library names
# others than its row, and mutexes that are listed and gone.
function(idle_of root out)
  set(found "")
  foreach(name IN LISTS row_names)
    file(GLOB files ${root}/${name}/*.hpp ${root}/${name}/*.cpp)
    set(included "")
    foreach(file IN LISTS files)
      file(STRINGS "${file}" lines REGEX "^[ \t]*#[ \t]*include[ \t]*\"")
      foreach(line IN LISTS lines)
        string(REGEX MATCH "\"([^\"]+)\"" matched "${line}")
        folder_of("${CMAKE_MATCH_1}" target)
        list(APPEND included "${target}")
      endforeach()
    endforeach()
    foreach(one IN LISTS may_${name})
      if(NOT one IN_LIST included)
        list(APPEND found "the row of ${name} names ${one}, which nothing there includes: take it out")
      endif()
    endforeach()
    if(name MATCHES "^api/(.*)$")
      file(READ "${root}/${name}/CMakeLists.txt" text)
      set(uses "")
      if(text MATCHES "\n *USES ([a-z ]+)\n")
        separate_arguments(uses UNIX_COMMAND "${CMAKE_MATCH_1}")
      endif()
      list(TRANSFORM uses PREPEND "api/")
      set(row ${may_${name}})
      list(FILTER row INCLUDE REGEX "^api/")
      list(SORT uses)
      list(SORT row)
      if(NOT uses STREQUAL row)
        list(APPEND found "${name}/CMakeLists.txt: USES ${uses} is not its row: ${row}")
      endif()
    endif()
  endforeach()
  foreach(one IN LISTS mutexes)
    string(REGEX REPLACE ":.*" "" file "${one}")
    set(own "")
    if(EXISTS "${root}/${file}")
      mutexes_of("${root}" "${file}" own)
    endif()
    if(NOT one IN_LIST own)
      list(APPEND found "the list of mutexes names ${one}, which is not there any more: take it out")
    endif()
  endforeach()
  set(${out} "${found}" PARENT_SCOPE)
endfunction()

# violations_of(ROOT OUT): one line per broken rule.
function(violations_of root out)
  set(found "")
  set(count 0)
  foreach(top core drivers api server migrations)
    file(GLOB_RECURSE files RELATIVE ${root} ${root}/${top}/*.hpp ${root}/${top}/*.cpp ${root}/${top}/*.h)
    foreach(file IN LISTS files)
      math(EXPR count "${count} + 1")
      foreach(candidate IN LISTS folders)
        if(file MATCHES "^${candidate}/")
          set(folder ${candidate})
          break()
        endif()
      endforeach()
      folder_of("${file}" part)
      if(NOT part IN_LIST row_names)
        list(APPEND found "${file}: ${part} has no row in tests/layering_test.cmake")
      endif()
      foreach(rule IN LISTS single)
        if(NOT file MATCHES "${${rule}_files}" AND (NOT DEFINED ${rule}_in OR file MATCHES "${${rule}_in}"))
          file(STRINGS "${root}/${file}" lines REGEX "${${rule}_line}")
          if(lines)
            list(APPEND found "${file}: ${${rule}_why}")
          endif()
        endif()
      endforeach()
      mutexes_of("${root}" "${file}" own)
      foreach(one IN LISTS own)
        if(NOT one IN_LIST mutexes)
          list(APPEND found "${one}: data and its mutex are a Locked (core/base/locked.hpp), and one that serialises an action is listed in tests/layering_test.cmake")
        endif()
      endforeach()
      file(STRINGS "${root}/${file}" lines REGEX "^[ \t]*#[ \t]*include")
      foreach(line IN LISTS lines)
        if(line MATCHES "include[ \t]*\"([^\"]+)\"")
          set(name "${CMAKE_MATCH_1}")
          folder_of("${name}" target)
          if(NOT target STREQUAL part AND NOT target IN_LIST may_${part})
            list(APPEND found "${file}: ${part} may not include \"${name}\"")
          endif()
        elseif(line MATCHES "include[ \t]*<([^>]+)>")
          set(name "${CMAKE_MATCH_1}")
          if(name MATCHES "^[a-z0-9_]+$")
            continue()  # the standard library
          endif()
          if(name MATCHES "${${folder}_header}")
            continue()
          endif()
          if(name MATCHES "${${folder}_source}")
            if(file MATCHES "\\.cpp$")
              continue()
            endif()
            list(APPEND found "${file}: <${name}> belongs in .cpp files only")
          else()
            list(APPEND found "${file}: ${folder} may not include <${name}>")
          endif()
        else()
          list(APPEND found "${file}: cannot read: ${line}")
        endif()
      endforeach()
    endforeach()
  endforeach()
  if(count EQUAL 0)
    list(APPEND found "no source files below ${root}")
  endif()
  set(${out} "${found}" PARENT_SCOPE)
  set(${out}_count ${count} PARENT_SCOPE)
endfunction()

# expect(FILE INCLUDE VERDICT): a tree of this one file is clean or broken.
function(expect file include verdict)
  file(REMOVE_RECURSE "${SELF_TEST}")
  file(WRITE "${SELF_TEST}/${file}" "// a file\n#include ${include}\nint x;\n")
  violations_of("${SELF_TEST}" broken)
  if(verdict STREQUAL "clean" AND broken)
    message(SEND_ERROR "refused wrongly: ${broken}")
  elseif(verdict STREQUAL "broken" AND NOT broken)
    message(SEND_ERROR "not noticed: ${file} includes ${include}")
  endif()
endfunction()

# expect_text(FILE TEXT VERDICT): the same of a line of code.
function(expect_text file text verdict)
  file(REMOVE_RECURSE "${SELF_TEST}")
  file(WRITE "${SELF_TEST}/${file}" "// a file\n${text}\n")
  violations_of("${SELF_TEST}" broken)
  if(verdict STREQUAL "clean" AND broken)
    message(SEND_ERROR "refused wrongly: ${broken}")
  elseif(verdict STREQUAL "broken" AND NOT broken)
    message(SEND_ERROR "not noticed: ${file} has ${text}")
  endif()
endfunction()

if(SELF_TEST)
  expect(core/base/a.hpp "\"core/base/ids.hpp\"" clean)
  expect(core/geo/a.cpp "<ceres/ceres.h>" clean)
  expect(core/base/a.cpp "<openssl/evp.h>" clean)
  expect(core/geo/a.cpp "<openssl/evp.h>" broken)
  expect(core/base/a.hpp "<ceres/ceres.h>" broken)
  expect(core/base/a.cpp "\"api/kit/message.hpp\"" broken)
  expect(core/base/a.cpp "\"../server/app.hpp\"" broken)
  expect(core/base/a.cpp "<nlohmann/json.hpp>" broken)
  expect(core/base/a.cpp "<boost/asio/io_context.hpp>" broken)
  expect(core/base/a.cpp "<some/new/library.hpp>" broken)
  expect(core/base/a.hpp "<vector>" clean)
  expect(core/base/a.hpp "  <boost/outcome/try.hpp>" clean)
  expect(drivers/port/a.cpp "\"core/types/fix.hpp\"" clean)
  expect(drivers/port/a.cpp "\"core/localize/solver.hpp\"" broken)
  expect(drivers/port/a.cpp "\"api/stream/hub.hpp\"" broken)
  expect(drivers/port/a.hpp "<boost/asio/awaitable.hpp>" clean)
  expect(api/kit/a.hpp "<nlohmann/json_fwd.hpp>" clean)
  expect(api/kit/a.hpp "<nlohmann/json.hpp>" broken)
  expect(api/kit/a.cpp "<nlohmann/json.hpp>" clean)
  expect(api/kit/a.cpp "\"drivers/sim/flight.hpp\"" broken)
  expect(api/kit/a.cpp "\"server/app/app.hpp\"" broken)
  expect(api/kit/a.cpp "<sqlite3.h>" broken)
  expect(server/storage/a.cpp "<sqlite3.h>" clean)
  expect(server/storage/a.cpp "\"core/localize/solver.hpp\"" broken)
  expect(server/storage/a.cpp "\"api/kit/message.hpp\"" broken)
  expect(server/app/a.cpp "<sqlite3.h>" broken)
  expect(server/cli/a.hpp "<nlohmann/json_fwd.hpp>" clean)
  expect(server/cli/a.hpp "<nlohmann/json.hpp>" broken)
  expect(server/storage/a.cpp "<libpq-fe.h>" clean)
  expect(server/app/a.cpp "<libpq-fe.h>" broken)
  expect(server/mqtt/a.cpp "<mosquitto.h>" clean)
  expect(server/app/a.cpp "<mosquitto.h>" broken)
  expect(server/app/a.hpp "<CLI/CLI.hpp>" broken)
  expect(server/flight/a.cpp "\"drivers/sim/flight.hpp\"" clean)
  expect_text(api/kit/a.cpp "out = json.dump()" broken)
  expect_text(api/kit/a.cpp "out = json->dump(-1, ' ', false, Json::error_handler_t::replace)" broken)
  expect_text(drivers/port/a.cpp "      .dump(1)" broken)
  expect_text(server/app/a.hpp "  std::thread thread_" broken)
  expect_text(api/kit/a.cpp "  std::vector<std::jthread> helpers" broken)
  expect_text(drivers/port/a.cpp "auto later = std::async(work)" broken)
  expect_text(api/kit/a.cpp "Thread(name, work); std::this_thread::yield(); std::thread::hardware_concurrency()" clean)
  expect_text(core/base/guard.hpp "  std::thread thread_" clean)
  expect_text(api/kit/a.cpp "} catch (...) {" broken)
  expect_text(api/kit/a.cpp "} catch (const Json::exception&) {" clean)
  expect_text(core/base/to_wire.hpp "return json.dump(indent)" clean)
  expect_text(server/app/a.cpp "out = to_wire(json) + core_dump(1)" clean)
  expect(core/flight/a.cpp "\"core/procedure/machine.hpp\"" clean)
  expect(core/flight/a.cpp "\"api/stream/hub.hpp\"" broken)
  expect(core/flight/a.cpp "<ceres/ceres.h>" broken)
  expect(core/flight/a.cpp "<nlohmann/json.hpp>" broken)
  expect_text(core/flight/a.cpp "const auto now = std::chrono::steady_clock::now();" broken)
  expect_text(core/flight/a.cpp "out.at = deps.clock.now();" broken)
  expect_text(core/flight/a.hpp "  std::mutex mutex_;" broken)
  expect_text(core/flight/a.hpp "  Locked<int> state_;" broken)
  expect_text(core/flight/a.hpp "  const Now now; clock(now)" clean)
  expect_text(api/missions/a.hpp "  std::mutex mutex_;" broken)
  expect_text(api/missions/a.hpp "  mutable std::shared_mutex mutex;" broken)
  expect_text(api/missions/a.cpp "  std::timed_mutex changing_{};" broken)
  expect_text(api/missions/a.cpp "  std::mutex first, second;" broken)
  expect_text(api/missions/a.hpp "  Locked<int> state_; const std::scoped_lock one(changing_)" clean)
  expect_text(api/missions/a.hpp "  Locked<int, std::shared_mutex> state_; void take(std::mutex& other)" clean)
  expect_text(api/devices/device_stream.hpp "  std::mutex changing_;" clean)
  expect_text(api/devices/device_stream.hpp "  std::mutex mutex_;" broken)
  expect_text(api/missions/a.hpp "  LiveFlight live;" broken)
  expect_text(api/missions/a.hpp "  procedure::FlightControl control;" broken)
  expect_text(api/missions/a.hpp "  flight::LiveMission live;" clean)
  # Within one layer: down, never back up, never past a folder that has no row.
  expect(core/localize/a.cpp "\"core/planning/bounds.hpp\"" clean)
  expect(core/localize/a.cpp "\"core/procedure/machine.hpp\"" broken)
  expect(drivers/gnss/a.hpp "\"drivers/port/driver.hpp\"" clean)
  expect(drivers/gnss/a.hpp "\"drivers/device/device_loop.hpp\"" broken)
  expect(api/flight/a.cpp "\"api/missions/routes.hpp\"" clean)
  expect(api/missions/a.cpp "\"api/flight/flight_service.hpp\"" broken)
  expect(api/learning/a.cpp "\"api/measurements/ingest.hpp\"" broken)
  expect(api/kit/a.cpp "\"api/admin/event_log.hpp\"" broken)
  expect(api/flight/a.hpp "\"api/application.hpp\"" broken)
  expect(api/application.cpp "\"api/flight/routes.hpp\"" clean)
  expect(server/storage/a.cpp "\"server/app/app.hpp\"" broken)
  expect(server/http/a.cpp "\"server/app/app.hpp\"" broken)
  expect(api/helpers/a.cpp "\"core/base/ids.hpp\"" broken)
  if(rows_broken)
    message(SEND_ERROR "refused wrongly: ${rows_broken}")
  endif()
  read_rows("core/a: core/b;core/b: core/a" circle)
  if(NOT circle)
    message(SEND_ERROR "a circle in the table passes")
  endif()
  read_rows("${rows}" rows_broken)
  file(REMOVE_RECURSE "${SELF_TEST}")
  file(MAKE_DIRECTORY "${SELF_TEST}")
  violations_of("${SELF_TEST}" broken)
  if(NOT broken)
    message(SEND_ERROR "an empty tree passes")
  endif()
else()
  violations_of("${ROOT}" broken)
  idle_of("${ROOT}" idle)
  list(APPEND broken ${rows_broken} ${idle})
  foreach(violation IN LISTS broken)
    message(SEND_ERROR "${violation}")
  endforeach()
  message(STATUS "layering: ${broken_count} files read")
endif()
