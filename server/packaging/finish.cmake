# Run by CPack on the staged files, before they become a package. Everything made here depends on the executable, the
# sources and SOURCE_DATE_EPOCH alone, so that two builds of a commit are the same bytes.
set(stage ${CPACK_TEMPORARY_INSTALL_DIRECTORY})
set(usr ${stage}/usr)
set(doc ${usr}/share/doc/anchord)
set(program ${CPACK_ANCHORD_EMULATOR} ${CPACK_ANCHORD_BINARY})

function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE code ERROR_VARIABLE error)
  if(NOT code EQUAL 0)
    list(JOIN ARGV " " command)
    message(FATAL_ERROR "packaging: exit code ${code} from: ${command}\n${error}")
  endif()
endfunction()
# print_to(FILE arguments...): what the program prints.
function(print_to file)
  get_filename_component(folder ${file} DIRECTORY)
  file(MAKE_DIRECTORY ${folder})
  execute_process(COMMAND ${program} ${ARGN} OUTPUT_FILE ${file} RESULT_VARIABLE code)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "packaging: exit code ${code} from: ${program} ${ARGN}")
  endif()
endfunction()

set(epoch $ENV{SOURCE_DATE_EPOCH})
if(NOT epoch MATCHES "^[0-9]+$")
  message(FATAL_ERROR "packaging: SOURCE_DATE_EPOCH is not set: ./dev package sets it to the time of the commit")
endif()

print_to(${usr}/share/man/man1/anchord.1 man)
print_to(${usr}/share/bash-completion/completions/anchord completion bash)
print_to(${usr}/share/zsh/vendor-completions/_anchord completion zsh)

execute_process(COMMAND date -u -R -d @${epoch} OUTPUT_VARIABLE date OUTPUT_STRIP_TRAILING_WHITESPACE)
file(WRITE ${doc}/changelog "anchord (${CPACK_PACKAGE_VERSION}) unstable; urgency=medium

  * What changed is in CHANGELOG.md.gz beside this file.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}
")
file(COPY ${CPACK_ANCHORD_SOURCE_DIR}/CHANGELOG.md DESTINATION ${doc})
run(${CPACK_ANCHORD_PYTHON} ${CPACK_ANCHORD_SOURCE_DIR}/server/packaging/sbom.py --binary ${CPACK_ANCHORD_BINARY}
  --source ${CPACK_ANCHORD_SOURCE_DIR} --version ${CPACK_PACKAGE_VERSION} --epoch ${epoch}
  --sbom ${doc}/anchord.spdx.json --licences ${doc}/licences.txt)
run(gzip -9nf ${usr}/share/man/man1/anchord.1 ${doc}/changelog ${doc}/CHANGELOG.md ${doc}/licences.txt)
run(find ${stage} -mindepth 1 -type d -empty -delete)  # of the prefix, where nothing is put
run(find ${stage} -type d -exec chmod 0755 {} +)
run(find ${stage} -type f -not -path "*/bin/*" -exec chmod 0644 {} +)
run(find ${stage} -exec touch -h -d @${epoch} {} +)
