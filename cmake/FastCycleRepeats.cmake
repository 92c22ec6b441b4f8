# The test of fastcycle_determinism_test(): records a run of APPLICATION for TIME, and executes it again.
set(log ${FOLDER}/repeats.mcap)
file(REMOVE_RECURSE ${FOLDER})
file(MAKE_DIRECTORY ${FOLDER})
execute_process(COMMAND ${FASTCYCLE} run ${APPLICATION} --for ${TIME} --quiet --record ${log}
                WORKING_DIRECTORY ${FOLDER} COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${FASTCYCLE} verify ${log} ${APPLICATION}
                WORKING_DIRECTORY ${FOLDER} COMMAND_ERROR_IS_FATAL ANY)
